#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <string_view>

#include "pencilscan/core/error.h"

// What the harnesses share. Each defines LLVMFuzzerTestOneInput(), which the fuzzer calls with
// bytes that it makes up and feed_files.cpp with saved ones.

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace pencilscan::fuzz {

/// A folder of this process, in memory where the system has such a place; removed at the end.
inline const std::filesystem::path& scratch() {
  struct Scratch {
    std::filesystem::path path =
        (std::filesystem::exists("/dev/shm") ? std::filesystem::path("/dev/shm")
                                             : std::filesystem::temp_directory_path()) /
        ("pencilscan_fuzz_" + std::to_string(::getpid()));
    Scratch() { std::filesystem::create_directories(path); }
    ~Scratch() {
      std::error_code ignored;
      std::filesystem::remove_all(path, ignored);
    }
  };
  static const Scratch folder;
  return folder.path;
}

inline std::filesystem::path put(const std::string& name, std::string_view bytes) {
  std::filesystem::path path = scratch() / name;
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  if (file < 0 || ::write(file, bytes.data(), bytes.size()) != ssize_t(bytes.size())) std::abort();
  ::close(file);
  return path;
}

inline std::string_view text_of(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

/// Runs what reads the input. Bad input may be refused, and a stage may fail; everything else that
/// is thrown (memory that is not there, a check of ours) ends the process, which is a finding.
template <class Read>
void answered(Read read) {
  try {
    read();
  } catch (const InputError&) {
  } catch (const StageError&) {
  }
}

/// The input as choices, for inputs that are made of valid parts.
class Choices {
 public:
  explicit Choices(std::string_view bytes) : rest_(bytes) {}

  [[nodiscard]] bool any() const { return !rest_.empty(); }
  /// Below `count`; 0 once the input is used up.
  std::size_t below(std::size_t count) {
    std::size_t value = 0;
    for (std::size_t range = 1; range < count; range *= 256) value = value * 256 + byte();
    return count == 0 ? 0 : value % count;
  }
  std::uint8_t byte() {
    if (rest_.empty()) return 0;
    const auto value = static_cast<std::uint8_t>(rest_.front());
    rest_.remove_prefix(1);
    return value;
  }
  /// Up to the next byte 0, which is left out, or all of it.
  std::string_view part() {
    const auto end = rest_.find('\0');
    const std::string_view part = rest_.substr(0, end);
    rest_.remove_prefix(end == rest_.npos ? rest_.size() : end + 1);
    return part;
  }
  [[nodiscard]] std::string_view rest() const { return rest_; }

 private:
  std::string_view rest_;
};

}  // namespace pencilscan::fuzz
