#include "pencilscan/io/partial_folder.h"

#include <sys/stat.h>

#include "pencilscan/core/error.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

bool is_there(const fs::path& path) {
  std::error_code ignored;
  return fs::exists(fs::symlink_status(path, ignored));
}

/// True for a folder that is on another device than the one that it lies in.
bool is_mount_point(const fs::path& folder) {
  struct stat own {};
  struct stat above {};
  return ::stat(folder.c_str(), &own) == 0 && ::stat(folder.parent_path().c_str(), &above) == 0 &&
         own.st_dev != above.st_dev;
}

}  // namespace

ReplacingFolder::ReplacingFolder(const fs::path& target)
    : target_(fs::weakly_canonical(bare_folder(target))), partial_(target_.string() + ".partial") {
  if (is_mount_point(target_)) {
    throw InputError(target_.string(), "", "",
                     "must not be a mount point, which cannot be renamed: name a folder in it");
  }
  fs::create_directories(partial_);
  lock_ = FolderLock(partial_);
  // Where it could not even be opened, writing into it says why.
  if (lock_.is_taken() && lock_.error() == 0)
    throw InputError(target_.string(), "", "", "is being made by another program");
  restore();
  fs::remove_all(path());
}

ReplacingFolder::~ReplacingFolder() {
  try {
    restore();
    fs::remove_all(partial_);
  } catch (const fs::filesystem_error&) {
    // What was there is kept in the partial folder, and the next run puts it back.
  }
}

/// A program that was killed between two names left what was there under neither.
void ReplacingFolder::restore() {
  const fs::path old = partial_ / "old";
  if (!is_there(target_) && is_there(old)) fs::rename(old, target_);
  fs::remove_all(old);
}

void ReplacingFolder::publish() {
  if (is_there(target_)) fs::rename(target_, partial_ / "old");
  fs::rename(path(), target_);
}

}  // namespace pencilscan
