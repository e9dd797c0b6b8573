#include "pencilscan/core/child_process.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include "pencilscan/core/error.h"

namespace pencilscan {
namespace {

using Seconds = ChildProcess::Seconds;
using ::testing::HasSubstr;

ChildProcess::Options with_pipes() {
  ChildProcess::Options options;
  options.pipes = true;
  return options;
}

TEST(ChildProcess, IsTalkedToByLines) {
  ChildProcess cat({"cat"}, with_pipes());
  EXPECT_TRUE(cat.write_line("one"));
  EXPECT_TRUE(cat.write_line("two words"));
  EXPECT_EQ(cat.read_line(Seconds(10)), "one");
  EXPECT_EQ(cat.read_line(Seconds(10)), "two words");
  EXPECT_EQ(cat.read_line(Seconds(0.01)), std::nullopt);
}

TEST(ChildProcess, RunsWithoutAShell) {
  ChildProcess echo({"echo", "$HOME; `date` * > file"}, with_pipes());
  EXPECT_EQ(echo.read_line(Seconds(10)), "$HOME; `date` * > file");
  EXPECT_EQ(echo.wait(Seconds(10)), 0);
}

TEST(ChildProcess, TellsHowItEnded) {
  EXPECT_EQ(ChildProcess({"false"}).wait(Seconds(10)), 1);
  ChildProcess sleeping({"sleep", "100"});
  EXPECT_TRUE(sleeping.running());
  ::kill(sleeping.id(), SIGKILL);
  EXPECT_EQ(sleeping.wait(Seconds(10)), 128 + SIGKILL);
}

TEST(ChildProcess, AProgramThatIsNotThereIsAFailure) {
  try {
    ChildProcess({"pencilscan-no-such-program"});
    FAIL();
  } catch (const StageError& error) {
    EXPECT_THAT(error.what(), HasSubstr("pencilscan-no-such-program cannot be run"));
  }
}

TEST(ChildProcess, AnEndedListenerIsNoticedAndDoesNotEndUs) {
  ChildProcess gone({"true"}, with_pipes());
  EXPECT_EQ(gone.wait(Seconds(10)), 0);
  EXPECT_FALSE(gone.write_line("anybody there?"));
}

TEST(ChildProcess, GetsItsEnvironment) {
  ChildProcess::Options options = with_pipes();
  options.environment["PENCILSCAN_WORD"] = "a b";
  ChildProcess printenv({"printenv", "PENCILSCAN_WORD"}, options);
  EXPECT_EQ(printenv.read_line(Seconds(10)), "a b");
}

}  // namespace
}  // namespace pencilscan
