#pragma once

#include <filesystem>
#include <system_error>
#include <utility>

#include "pencilscan/io/folder_lock.h"

namespace pencilscan {

/// A folder as a user gives it, by a name that others can stand beside: "film/" is "film", and "."
/// is the whole path.
[[nodiscard]] inline std::filesystem::path bare_folder(const std::filesystem::path& folder) {
  std::filesystem::path bare = folder.lexically_normal();
  if (bare == "." || bare.filename() == "..") bare = std::filesystem::absolute(bare);
  bare = bare.lexically_normal();
  return bare.has_filename() ? bare : bare.parent_path();
}

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

/// A folder that is made beside its target, in `<target>.partial`. The target stays what it is
/// until the new one is whole; what a program that was killed left is put right first. InputError
/// while another program makes it, or where it could not be renamed: a mount point. A link is
/// followed.
class ReplacingFolder {
 public:
  explicit ReplacingFolder(const std::filesystem::path& target);
  ~ReplacingFolder();
  ReplacingFolder(const ReplacingFolder&) = delete;
  ReplacingFolder& operator=(const ReplacingFolder&) = delete;

  /// Where to make it.
  [[nodiscard]] std::filesystem::path path() const { return partial_ / "new"; }

  /// Puts it in the target's place. What was there goes last.
  void publish();

 private:
  void restore();

  std::filesystem::path target_;
  std::filesystem::path partial_;
  FolderLock lock_;
};

}  // namespace pencilscan
