#pragma once

#include <filesystem>
#include <system_error>
#include <utility>

namespace pencilscan {

/// A name below which a command collects what is to appear as a whole: what an interrupted one left
/// there is removed first, and what was not moved away by then at the end.
class PartialFolder {
 public:
  explicit PartialFolder(std::filesystem::path path) : path_(std::move(path)) {
    std::filesystem::remove_all(path_);
  }
  ~PartialFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  PartialFolder(const PartialFolder&) = delete;
  PartialFolder& operator=(const PartialFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace pencilscan
