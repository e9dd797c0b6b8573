#pragma once

#include <filesystem>
#include <utility>

namespace pencilscan {

/// The lock of a folder that one program at a time works in. It ends with this value, or with the
/// program. File systems without locks give neither a lock nor somebody who has it.
class FolderLock {
 public:
  FolderLock() = default;  ///< of no folder
  explicit FolderLock(const std::filesystem::path& folder);
  FolderLock(FolderLock&& other) noexcept { *this = std::move(other); }
  FolderLock& operator=(FolderLock&& other) noexcept {
    std::swap(file_, other.file_);
    std::swap(is_taken_, other.is_taken_);
    std::swap(error_, other.error_);
    return *this;
  }
  ~FolderLock() { release(); }

  [[nodiscard]] bool is_held() const { return file_ >= 0; }
  /// True where somebody else has it, or the folder has been removed or cannot be opened.
  [[nodiscard]] bool is_taken() const { return is_taken_; }
  /// Why the folder could not be opened, an errno; 0: it could.
  [[nodiscard]] int error() const { return error_; }
  void release();

 private:
  int file_ = -1;  ///< of the lock that is held
  bool is_taken_ = false;
  int error_ = 0;
};

}  // namespace pencilscan
