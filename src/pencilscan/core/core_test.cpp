#include <gtest/gtest.h>
#include <pthread.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <new>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include "pencilscan/core/cancellation.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/lanes.h"
#include "pencilscan/core/memory.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/core/random.h"

namespace pencilscan {
namespace {

TEST(Formatted, PercentagesAreWholeNumbersFromTenUp) {
  const std::vector<std::pair<double, std::string>> texts{
      {1, "100 %"},      {0.997, "100 %"},   {0.384, "38 %"},   {0.0996, "10 %"},
      {0.0424, "4.2 %"}, {0.0004, "0.04 %"}, {-0.384, "-38 %"}, {0, "0 %"}};
  for (const auto& [share, text] : texts) EXPECT_EQ(percent_text(share), text);
}

TEST(ParallelFor, VisitsEveryIndexOnceForAnyThreadCount) {
  for (const int threads : {1, 2, 4}) {
    const ThreadLimit limit(threads);
    std::vector<int> visits(1000, 0);
    parallel_for(visits.size(), [&](std::size_t i) { ++visits[i]; });
    EXPECT_EQ(std::accumulate(visits.begin(), visits.end(), 0), 1000);
    EXPECT_EQ(*std::max_element(visits.begin(), visits.end()), 1);
  }
}

TEST(ParallelFor, PassesExceptionsOn) {
  EXPECT_THROW(parallel_for(10,
                            [](std::size_t i) {
                              if (i == 7) throw StageError("seven");
                            }),
               StageError);
}

TEST(ParallelFor, StopsNestedLoopsWhenAsked) {
  std::atomic<bool> stop{false};
  std::atomic<int> bodies{0};
  constexpr int kOuter = 100;
  constexpr int kInner = 1000;
  {
    const CancelScope scope(stop);
    EXPECT_THROW(parallel_for(kOuter,
                              [&](std::size_t) {
                                parallel_for(kInner, [&](std::size_t) {
                                  if (++bodies == kInner / 2) stop = true;
                                });
                              }),
                 Cancelled);
    EXPECT_THROW(parallel_for(1, [](std::size_t) {}), Cancelled);
  }
  EXPECT_LT(bodies, 2 * kInner);
  parallel_for(1, [&](std::size_t) { bodies = 0; });  // outside the scope
  EXPECT_EQ(bodies, 0);
}

TEST(RunAtOnce, KeepsToItsNumberAndDoesAll) {
  std::atomic<int> now{0};
  std::atomic<int> most{0};
  std::vector<int> visits(40, 0);
  run_at_once(visits.size(), 3, [&](std::size_t i) {
    const int here = ++now;
    for (int seen = most; here > seen && !most.compare_exchange_weak(seen, here);) {
    }
    parallel_for(10, [](std::size_t) {});
    ++visits[i];
    --now;
  });
  EXPECT_LE(most, 3);
  EXPECT_EQ(std::accumulate(visits.begin(), visits.end(), 0), 40);
  EXPECT_EQ(*std::max_element(visits.begin(), visits.end()), 1);
}

TEST(RunAtOnce, PassesTheFirstExceptionOnAndStartsNoMore) {
  std::atomic<int> started{0};
  try {
    run_at_once(1000, 2, [&](std::size_t i) {
      ++started;
      if (i >= 3) throw StageError(std::to_string(i));
    });
    FAIL() << "nothing was thrown";
  } catch (const StageError& error) {
    EXPECT_STREQ(error.what(), "3");
  }
  EXPECT_LE(started, 5);
}

TEST(RunAtOnce, HearsThatItIsToStop) {
  std::atomic<bool> stop{false};
  const CancelScope scope(stop);
  std::atomic<int> bodies{0};
  EXPECT_THROW(run_at_once(1000, 2, [&](std::size_t) { stop = ++bodies > 5; }), Cancelled);
  EXPECT_LT(bodies, 10);
}

/// Bytes of address space that this process has.
rlim_t address_space() {
  std::ifstream pages("/proc/self/statm");
  rlim_t count = 0;
  pages >> count;
  return count * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE));
}

/// Ends with 0 where all is done although the system gives one more thread and no second one.
[[noreturn]] void run_where_threads_are_few() {
  constexpr std::size_t kStack = std::size_t{1} << 30;  // with all that comes with a thread
  pthread_attr_t attributes;
  ::pthread_attr_init(&attributes);
  ::pthread_attr_setstacksize(&attributes, kStack);
  ::pthread_setattr_default_np(&attributes);
  rlimit limit{};
  limit.rlim_cur = limit.rlim_max = address_space() + kStack * 3 / 2;
  ::setrlimit(RLIMIT_AS, &limit);
  std::atomic<int> done{0};
  run_at_once(100, 8, [&](std::size_t) { ++done; });
  ::_exit(done == 100 ? 0 : 1);
}

TEST(RunAtOnce, GoesOnWithFewerThreadsWhereTheSystemGivesNoMore) {
  EXPECT_EXIT(run_where_threads_are_few(), testing::ExitedWithCode(0), "");
}

TEST(Random, NormalHasUnitVarianceAndUniformItsMoments) {
  Random random(7);
  double sum = 0;
  double squares = 0;
  double uniform_sum = 0;
  constexpr int kDraws = 100000;
  for (int i = 0; i < kDraws; ++i) {
    const double x = random.normal();
    sum += x;
    squares += x * x;
    uniform_sum += random.uniform();
  }
  // Five standard errors of each mean.
  EXPECT_NEAR(sum / kDraws, 0, 5 / std::sqrt(kDraws));
  EXPECT_NEAR(squares / kDraws, 1, 5 * std::sqrt(2.0 / kDraws));
  EXPECT_NEAR(uniform_sum / kDraws, 0.5, 5 * std::sqrt(1.0 / 12 / kDraws));
}

TEST(Random, StreamsOfOneSeedDiffer) {
  Random a(1, 0);
  Random b(1, 1);
  int equal = 0;
  for (int i = 0; i < 100; ++i) equal += a.bits() == b.bits();
  EXPECT_LT(equal, 3);
}

TEST(InputError, NamesFileFieldValueAndRule) {
  const InputError error("rig.json", "cameras[0].K", "nan", "must be finite");
  EXPECT_STREQ(error.what(), "rig.json: cameras[0].K = nan: must be finite");
}

// Where single precision holds x itself to 5e-6 of a unit.
TEST(Memory, LackOfItIsToldInPlainWordsWhoeverLacksIt) {
  const std::system_error no_thread(EAGAIN, std::generic_category());
  const std::system_error no_memory(ENOMEM, std::generic_category());
  const std::runtime_error of_opencv("OpenCV(4.6.0) alloc.cpp:73: error: (-4:Insufficient memory)");
  for (const std::exception* error : {static_cast<const std::exception*>(&no_thread),
                                      static_cast<const std::exception*>(&no_memory),
                                      static_cast<const std::exception*>(&of_opencv)}) {
    EXPECT_TRUE(is_of_memory(*error)) << error->what();
    EXPECT_NE(in_plain_words(*error).find("not enough memory"), std::string::npos);
  }
  EXPECT_TRUE(is_of_memory(std::bad_alloc()));
  EXPECT_EQ(in_plain_words(StageError("no curve")), "no curve");
  EXPECT_FALSE(is_of_memory(std::system_error(ENOSPC, std::generic_category())));
}

/// A made-up folder of control groups, removed afterwards.
class ControlGroups : public ::testing::Test {
 protected:
  ControlGroups() { std::filesystem::remove_all(mount_); }
  ~ControlGroups() override { std::filesystem::remove_all(mount_); }
  void put(const std::string& file, const std::string& text) {
    const std::filesystem::path path = mount_ / file;
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path) << text << "\n";
  }

  std::filesystem::path mount_ = std::filesystem::path(::testing::TempDir()) /
                                 ("groups_" + std::to_string(::getpid()) + "_" +
                                  ::testing::UnitTest::GetInstance()->current_test_info()->name());
};

constexpr double kNoGroupLimit = std::numeric_limits<double>::infinity();

TEST_F(ControlGroups, TheTightestGroupUpToTheRootCounts) {
  const std::string groups = "0::/slurm/job_7/step_0\n";
  EXPECT_EQ(memory_of_groups(groups, mount_), kNoGroupLimit);  // no file at all
  put("slurm/job_7/step_0/memory.max", "max");
  put("slurm/job_7/step_0/memory.current", "100");
  EXPECT_EQ(memory_of_groups(groups, mount_), kNoGroupLimit);
  put("slurm/job_7/memory.max", "5000");
  put("slurm/job_7/memory.current", "1200");
  EXPECT_EQ(memory_of_groups(groups, mount_), 3800);
  // Copies of files count as used, but give way.
  put("slurm/job_7/memory.stat", "anon 900\ninactive_file 300\nactive_file 50\nslab_reclaimable 7");
  EXPECT_EQ(memory_of_groups(groups, mount_), 4157);
  put("slurm/memory.max", "9000");
  put("slurm/memory.current", "8500");
  EXPECT_EQ(memory_of_groups(groups, mount_), 500);
  put("slurm/job_8/memory.max", "1");  // another job's
  put("slurm/job_8/memory.current", "1");
  EXPECT_EQ(memory_of_groups(groups, mount_), 500);
  put("slurm/memory.current", "9100");
  EXPECT_EQ(memory_of_groups(groups, mount_), 0);
}

TEST_F(ControlGroups, AContainerSeesItsOwnAsTheRoot) {
  put("memory.max", "7000");
  put("memory.current", "3000");
  EXPECT_EQ(memory_of_groups("0::/\n", mount_), 4000);
  EXPECT_EQ(memory_of_groups("0::/docker/of_the_host\n", mount_), 4000);
}

TEST_F(ControlGroups, TheFirstVersionCountsToo) {
  const std::string groups = "5:cpu,cpuacct:/a\n4:hugetlb,memory:/job\n1:name=systemd:/\n0::/\n";
  put("memory/memory.limit_in_bytes", "9223372036854771712");
  put("memory/memory.usage_in_bytes", "123456");
  EXPECT_EQ(memory_of_groups(groups, mount_), kNoGroupLimit);
  put("memory/job/memory.limit_in_bytes", "6000");
  EXPECT_EQ(memory_of_groups(groups, mount_), kNoGroupLimit);  // used by whom is not known
  put("memory/job/memory.usage_in_bytes", "4000");
  put("memory/job/memory.stat", "inactive_file 7\ntotal_inactive_file 1000\ntotal_active_file 200");
  EXPECT_EQ(memory_of_groups(groups, mount_), 3200);
  put("memory.max", "700");  // of version 2, where both are
  put("memory.current", "0");
  EXPECT_EQ(memory_of_groups(groups, mount_), 700);
}

TEST_F(ControlGroups, WhatIsNoListOfGroupsIsNoLimit) {
  put("memory.max", "1");
  put("memory.current", "0");
  for (const char* text : {"", "\n", "0", "0:", "x:y", "3:cpu:/"})
    EXPECT_EQ(memory_of_groups(text, mount_), kNoGroupLimit) << text;
  for (const char* absurd : {"-1", "", "many", "18446744073709551615"}) {
    put("memory.max", absurd);
    EXPECT_EQ(memory_of_groups("0::/", mount_), kNoGroupLimit) << absurd;
  }
}

TEST(Lanes, ExponentialIsThatOfTheLibrary) {
  constexpr double kTolerance = 1e-5;
  for (float x = -78; x < 78; x += 0.37F) {
    Lanes in{};
    in += x;
    Lanes out;
    exponential(in, out);
    const double expected = std::exp(static_cast<double>(x));
    EXPECT_NEAR(out[kLanes - 1] / expected, 1, kTolerance) << "x = " << x;
  }
}

TEST(Lanes, CosineAndSineOfTurnsAreThoseOfTheLibrary) {
  constexpr double kTolerance = 5e-7;
  for (int k = -400; k <= 400; ++k) {
    const auto x = static_cast<float>(0.017 * k);
    Lanes in{};
    in += x;
    Lanes cosine, sine;
    cosine_and_sine(in, cosine, sine);
    const double angle = 2 * std::numbers::pi * static_cast<double>(x);
    EXPECT_NEAR(cosine[kLanes - 1], std::cos(angle), kTolerance) << "x = " << x;
    EXPECT_NEAR(sine[kLanes - 1], std::sin(angle), kTolerance) << "x = " << x;
  }
}

}  // namespace
}  // namespace pencilscan
