#include "pencilscan/core/child_process.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include "pencilscan/core/error.h"

namespace pencilscan {
namespace {

using Seconds = ChildProcess::Seconds;
using ::testing::HasSubstr;

ChildProcess::Options with_pipe() {
  ChildProcess::Options options;
  options.piped = true;
  return options;
}

TEST(ChildProcess, IsReadByLines) {
  ChildProcess talking({"sh", "-c", "echo one; echo two words; exec sleep 100"}, with_pipe());
  EXPECT_EQ(talking.read_line(Seconds(10)), "one");
  EXPECT_EQ(talking.read_line(Seconds(10)), "two words");
  EXPECT_EQ(talking.read_line(Seconds(0.01)), std::nullopt);
}

TEST(ChildProcess, RunsWithoutAShell) {
  ChildProcess echo({"echo", "$HOME; `date` * > file"}, with_pipe());
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

TEST(ChildProcess, IsOutOfReachOfATerminalsCtrlC) {
  ChildProcess sleeping({"sleep", "100"});
  EXPECT_EQ(::getpgid(sleeping.id()), sleeping.id());
}

TEST(ChildProcess, GetsItsEnvironment) {
  ChildProcess::Options options = with_pipe();
  options.environment["PENCILSCAN_WORD"] = "a b";
  ChildProcess printenv({"printenv", "PENCILSCAN_WORD"}, options);
  EXPECT_EQ(printenv.read_line(Seconds(10)), "a b");
}

}  // namespace
}  // namespace pencilscan
