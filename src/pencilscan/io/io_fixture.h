#pragma once

// A folder for each test of files, and what reading says.

#include <gtest/gtest.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "pencilscan/core/error.h"
#include "pencilscan/io/temporary_folder.h"

namespace pencilscan {

/// A folder of its own per test, removed afterwards.
class Io : public ::testing::Test {
 protected:
  std::filesystem::path put(const std::string& name, const std::string& bytes) {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return folder_ / name;
  }
  void truncate(const std::filesystem::path& path, double share) {
    std::filesystem::resize_file(
        path, static_cast<std::uintmax_t>(share * double(std::filesystem::file_size(path))));
  }
  std::size_t file_count() {
    return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(folder_),
                                                  std::filesystem::directory_iterator{}));
  }

  TemporaryFolder temporary_{::testing::UnitTest::GetInstance()->current_test_info()->name()};
  std::filesystem::path folder_ = temporary_.path();
};

/// A user whom permissions bind, while it lives: of tests that root runs, nobody.
class BoundUser {
 public:
  BoundUser() : was_root_(::geteuid() == 0 && ::setresuid(kNobody, kNobody, 0) == 0) {}
  ~BoundUser() {
    if (!was_root_) return;
    EXPECT_EQ(::setresuid(0, 0, 0), 0);
    ::prctl(PR_SET_DUMPABLE, 1);  // which the change took away, and sanitizers need
  }
  BoundUser(const BoundUser&) = delete;
  BoundUser& operator=(const BoundUser&) = delete;

 private:
  static constexpr uid_t kNobody = 65534;
  bool was_root_;
};

/// The one-line error of reading; empty when nothing was thrown.
template <class Read>
std::string error_of(Read read) {
  try {
    (void)read();
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
    return error.what();
  }
  return "";
}

}  // namespace pencilscan
