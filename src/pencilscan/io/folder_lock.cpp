#include "pencilscan/io/folder_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

namespace pencilscan {

FolderLock::FolderLock(const std::filesystem::path& folder)
    : file_(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
  if (file_ < 0) {
    is_taken_ = true;
    error_ = errno;
    return;
  }
  const bool is_locked = ::flock(file_, LOCK_EX | LOCK_NB) == 0;
  is_taken_ = !is_locked && errno == EWOULDBLOCK;
  // A folder that was removed meanwhile has no links left.
  struct stat status {};
  if (::fstat(file_, &status) != 0 || status.st_nlink == 0) is_taken_ = true;
  if (!is_locked || is_taken_) release();
}

void FolderLock::release() {
  if (file_ >= 0) ::close(file_);
  file_ = -1;
}

}  // namespace pencilscan
