#include "pencilscan/io/file.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <streambuf>
#include <utility>
#include <vector>

#include "pencilscan/core/error.h"
#include "pencilscan/io/json_text.h"

namespace pencilscan {
namespace {

std::string reason(int error) { return std::strerror(error); }

/// Stream buffer over a file descriptor that remembers the first error, which std::ofstream hides.
class DescriptorBuffer : public std::streambuf {
 public:
  explicit DescriptorBuffer(int descriptor)
      : descriptor_(descriptor), block_(std::size_t{1} << 16) {
    setp(block_.data(), block_.data() + block_.size());
  }
  [[nodiscard]] int error() const { return error_; }

 protected:
  int overflow(int c) override {
    if (!drain()) return traits_type::eof();
    if (c != traits_type::eof()) {
      *pptr() = static_cast<char>(c);
      pbump(1);
    }
    return traits_type::not_eof(c);
  }
  int sync() override { return drain() ? 0 : -1; }

 private:
  bool drain() {
    const char* at = pbase();
    while (error_ == 0 && at < pptr()) {
      const ssize_t written = ::write(descriptor_, at, static_cast<std::size_t>(pptr() - at));
      if (written < 0) {
        if (errno != EINTR) error_ = errno;
      } else {
        at += written;
      }
    }
    setp(block_.data(), block_.data() + block_.size());
    return error_ == 0;
  }

  int descriptor_;
  int error_ = 0;
  std::vector<char> block_;
};

/// A file beside the target that gets its name when it is whole. Until then it has none where the
/// file system can do that, so that nothing is left of it when the program is killed; else one of
/// its own, which is removed unless it became the target.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::filesystem::path& target) {
    const std::filesystem::path folder = target.has_parent_path() ? target.parent_path() : ".";
    if (::access("/proc/self/fd", X_OK) == 0)
      descriptor_ = ::open(folder.c_str(), O_WRONLY | O_TMPFILE | O_CLOEXEC, 0666);
    if (descriptor_ >= 0) return;
    take_name_beside(target, [this] {
      descriptor_ = ::open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
      return descriptor_ >= 0;
    });
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  ~TemporaryFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
    if (named_) ::unlink(path_.c_str());
  }

  [[nodiscard]] int descriptor() const { return descriptor_; }
  /// Flushes to the disk if asked to and becomes the target; 0 or the errno of what failed.
  int become(const std::filesystem::path& target, Durability durability) {
    const bool flushed = durability == Durability::kProcess || ::fsync(descriptor_) == 0;
    if (!flushed && errno != EINVAL) return errno;
    // A new file needs no other name even for a moment.
    if (!named_ && link_as(target) == 0) return 0;
    if (!named_ && errno == EEXIST)
      take_name_beside(target, [this] { return link_as(path_) == 0; });
    if (!named_) return errno;
    const int descriptor = std::exchange(descriptor_, -1);
    if (::close(descriptor) != 0 || ::rename(path_.c_str(), target.c_str()) != 0) return errno;
    named_ = false;
    return 0;
  }

 private:
  /// Tries names until `take` gets one, or cannot for another reason than that the name is taken: a
  /// killed program may have left a file, and the numbers of processes repeat.
  template <typename Take>
  void take_name_beside(const std::filesystem::path& target, Take take) {
    static std::atomic<unsigned> counter{0};
    do {
      path_ = target;
      path_ += ".part" + std::to_string(::getpid()) + "_" + std::to_string(counter++);
      named_ = take();
    } while (!named_ && errno == EEXIST);
  }
  int link_as(const std::filesystem::path& name) const {
    const std::string unnamed = "/proc/self/fd/" + std::to_string(descriptor_);
    return ::linkat(AT_FDCWD, unnamed.c_str(), AT_FDCWD, name.c_str(), AT_SYMLINK_FOLLOW);
  }

  std::filesystem::path path_;
  int descriptor_ = -1;
  bool named_ = false;
};

[[noreturn]] void cannot_write(const std::filesystem::path& path, int error) {
  throw StageError(path.string() + ": cannot be written: " + reason(error));
}

}  // namespace

void write_atomically(const std::filesystem::path& path,
                      const std::function<void(std::ostream&)>& write, Durability durability) {
  std::error_code made;
  if (path.has_parent_path()) std::filesystem::create_directories(path.parent_path(), made);
  if (made) cannot_write(path, made.value());
  TemporaryFile file(path);
  if (file.descriptor() < 0) cannot_write(path, errno);
  DescriptorBuffer buffer(file.descriptor());
  std::ostream stream(&buffer);
  write(stream);
  stream.flush();
  if (buffer.error() != 0) cannot_write(path, buffer.error());
  if (!stream) throw StageError(path.string() + ": cannot be written: the stream failed");
  if (const int error = file.become(path, durability); error != 0) cannot_write(path, error);
}

void write_text(const std::filesystem::path& path, const std::string& text, Durability durability) {
  write_atomically(
      path, [&](std::ostream& stream) { stream << text; }, durability);
}

void write_json(const std::filesystem::path& path, const nlohmann::ordered_json& value,
                Durability durability) {
  write_text(path, json_text(value), durability);
}

std::string json_text(const nlohmann::ordered_json& value) {
  return value.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

std::string json_line(const nlohmann::ordered_json& value) {
  return value.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

bool is_utf8(const std::string& text) {
  try {
    static_cast<void>(nlohmann::json(text).dump());
    return true;
  } catch (const nlohmann::json::type_error&) {
    return false;
  }
}

std::string read_file(const std::filesystem::path& path) {
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (status.type() == std::filesystem::file_type::not_found) {
    throw InputError(path.string(), "", "", "the file does not exist");
  }
  if (status.type() == std::filesystem::file_type::none)
    throw InputError(path.string(), "", "", "cannot be opened: " + error.message());
  if (std::filesystem::is_directory(status)) {
    throw InputError(path.string(), "", "", "must be a file, is a folder");
  }
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw InputError(path.string(), "", "", "cannot be opened: " + reason(errno));
  // In blocks: `<<` of a stream's buffer takes lack of memory for the end of the file.
  std::string bytes;
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (!error) bytes.reserve(size);
  std::vector<char> block(std::size_t{1} << 16);
  while (stream.read(block.data(), static_cast<std::streamsize>(block.size())), stream.gcount() > 0)
    bytes.append(block.data(), static_cast<std::size_t>(stream.gcount()));
  if (stream.bad()) throw InputError(path.string(), "", "", "cannot be read");
  return bytes;
}

namespace {

/// nlohmann's message without its "[json.exception...]" tag: "parse error at line 1, column 9:
/// ...".
std::string without_tag(const std::string& message) {
  const auto end = message.find("] ");
  std::string text = end == std::string::npos ? message : message.substr(end + 2);
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < 0x20) c = ' ';
  }
  return text;
}

/// Levels of arrays and objects in each other. Our files have fewer than ten; what walks a value
/// level by level must not run out of stack.
constexpr int kDeepestLevel = 200;

/// The last key of an object that a parser event saw twice; JSON leaves it open, a rig cannot mean
/// it. And whether it is nested deeper than anything of ours.
struct DuplicateKeyFinder {
  std::vector<std::vector<std::string>> open;
  std::string duplicate;
  bool too_deep = false;

  /// That of the value at work.
  [[nodiscard]] std::string last_key() const {
    return open.empty() || open.back().empty() ? std::string() : open.back().back();
  }

  bool operator()(int depth, nlohmann::json::parse_event_t event, nlohmann::json& parsed) {
    using Event = nlohmann::json::parse_event_t;
    if (depth > kDeepestLevel) {
      too_deep = true;
      return false;  // leaves this value out
    }
    if (event == Event::object_start) open.emplace_back();
    if (event == Event::object_end) open.pop_back();
    if (event == Event::key) {
      const auto key = parsed.get<std::string>();
      for (const std::string& earlier : open.back()) {
        if (earlier == key) duplicate = key;
      }
      open.back().push_back(key);
    }
    return true;
  }
};

}  // namespace

nlohmann::json parse_json(const std::string& text, const std::string& name) {
  DuplicateKeyFinder finder;
  try {
    nlohmann::json value = nlohmann::json::parse(text, std::ref(finder));
    if (finder.too_deep) {
      throw InputError(
          name, "", "",
          "must not be nested deeper than " + std::to_string(kDeepestLevel) + " levels");
    }
    if (!finder.duplicate.empty())
      throw InputError(name, finder.duplicate, "", "this key must not stand twice");
    return value;
  } catch (const nlohmann::json::out_of_range& error) {  // a number that no double holds, as 1e999
    throw InputError(name, finder.last_key(), "", "must be finite: " + without_tag(error.what()));
  } catch (const nlohmann::json::exception& error) {
    throw InputError(name, "", "",
                     "must be JSON (which has no NaN or Infinity): " + without_tag(error.what()));
  }
}

std::string last_line(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::string last;
  for (std::string line; std::getline(file, line);) {
    if (!line.empty()) last = line;
  }
  return last;
}

nlohmann::json read_json(const std::filesystem::path& path) {
  return parse_json(read_file(path), path.string());
}

}  // namespace pencilscan
