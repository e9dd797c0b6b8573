#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

/// The bytes of a file.
inline std::string slurp(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// How the program ended.
struct Outcome {
  int code = -1;
  std::string error;   ///< stderr
  std::string output;  ///< stdout
};

/// The built program, run in a folder of the test's own.
class ProgramTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(::testing::TempDir()) /
              ("program_" + std::to_string(::getpid()) + "_" +
               ::testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  /// Runs the program in the test's folder, after what `before` does in the same shell ("ulimit -f
  /// 1 &&"), or by it ("timeout 5").
  Outcome run(const std::string& arguments, const std::string& before = "") {
    const std::string command = "cd '" + folder_.string() + "' && " + before + " '" +
                                PENCILSCAN_PROGRAM + "' " + arguments + " >stdout 2>stderr";
    const int status = std::system(command.c_str());
    Outcome outcome{WIFEXITED(status) ? WEXITSTATUS(status) : -1, slurp(folder_ / "stderr"),
                    slurp(folder_ / "stdout")};
    std::filesystem::remove(folder_ / "stdout");
    std::filesystem::remove(folder_ / "stderr");
    return outcome;
  }

  std::size_t file_count() {
    return static_cast<std::size_t>(
        std::distance(std::filesystem::recursive_directory_iterator(folder_), {}));
  }

  /// Exit code 2 and one line with these parts; nothing written.
  void expect_bad(const std::string& arguments, const std::string& part) {
    const std::size_t before = file_count();
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.code, 2) << arguments;
    EXPECT_THAT(outcome.error, ::testing::StartsWith("pencilscan: ")) << arguments;
    EXPECT_THAT(outcome.error, ::testing::HasSubstr(part)) << arguments;
    EXPECT_THAT(outcome.error, ::testing::EndsWith("\n")) << arguments;
    EXPECT_EQ(std::count(outcome.error.begin(), outcome.error.end(), '\n'), 1) << outcome.error;
    EXPECT_EQ(file_count(), before) << arguments;
  }

  std::filesystem::path folder_;
};
