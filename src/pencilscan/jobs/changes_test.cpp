#include "pencilscan/jobs/changes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "pencilscan/core/random.h"

namespace pencilscan {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kValues = 300;

std::vector<double> noise(double sigma, std::uint64_t seed) {
  Random random(seed);
  std::vector<double> values;
  for (std::size_t k = 0; k < kValues; ++k) values.push_back(1 + random.normal(0, sigma));
  return values;
}

/// A turning object: once round in five seconds.
double slow_wave(std::size_t k) {
  return 0.3 * std::sin(2 * std::numbers::pi * static_cast<double>(k) / 125);
}

TEST(Changes, NoiseAndSlowMotionAreNone) {
  std::size_t alarms = 0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    std::vector<double> values = noise(0.02, seed);
    alarms += find_changes(values, {0.01, 100 * kValues}).changes.size();
    for (std::size_t k = 0; k < kValues; ++k) values[k] += slow_wave(k);
    alarms += find_changes(values, {0.01, 100 * kValues}).changes.size();
  }
  EXPECT_EQ(alarms, 0U);
}

TEST(Changes, AStepIsFoundWhereItIs) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    std::vector<double> values = noise(0.02, seed);
    for (std::size_t k = 0; k < kValues; ++k) values[k] += k >= 200 ? 0.3 : 0;
    const ChangeReport report = find_changes(values, {0.05, 20 * kValues});
    ASSERT_THAT(report.changes, SizeIs(1));
    EXPECT_EQ(report.changes[0].at, 200U);
    EXPECT_NEAR(report.changes[0].before, 1, 0.03);
    EXPECT_NEAR(report.changes[0].after, 1.3, 0.06);
    EXPECT_GT(report.changes[0].spreads, 5);
  }
}

TEST(Changes, WhatReturnsIsAnOutlierAndUnknownValuesAreNothing) {
  std::vector<double> values = noise(0.02, 3);
  values[100] = 2;
  values[150] = values[151] = 0;
  for (std::size_t k = 170; k < 200; ++k) values[k] = kUnknown;
  const ChangeReport report = find_changes(values, {0.05, kValues});
  EXPECT_THAT(report.changes, IsEmpty());
  EXPECT_THAT(report.outliers, ElementsAre(100, 150, 151));
}

TEST(Changes, SmallerThanWhatCountsIsNone) {
  std::vector<double> values(kValues, 1.0);
  for (std::size_t k = 100; k < kValues; ++k) values[k] = 1.04;
  EXPECT_THAT(find_changes(values, {0.05, kValues}).changes, IsEmpty());
  EXPECT_THAT(find_changes(values, {0.03, kValues}).changes, SizeIs(1));
}

/// A step of `size` in the frames from `first` to before `end`.
std::vector<double> with_step(std::size_t first, std::size_t end, double size, std::uint64_t seed) {
  std::vector<double> values = noise(0.02, seed);
  for (std::size_t k = first; k < end; ++k) values[k] += size;
  return values;
}

/// Where changes begin, and end if they do.
std::vector<std::size_t> places(const ChangeReport& report) {
  std::vector<std::size_t> result;
  for (const Change& change : report.changes) {
    result.push_back(change.at);
    if (change.end) result.push_back(*change.end);
  }
  return result;
}

TEST(Changes, AShortOneEndsWhereItEnds) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    for (std::size_t frames = 3; frames <= 12; ++frames) {
      const ChangeReport report =
          find_changes(with_step(30, 30 + frames, 0.3, seed), {0.05, 20 * kValues});
      ASSERT_THAT(places(report), ElementsAre(30, 30 + frames)) << seed;
      ASSERT_THAT(report.changes, SizeIs(1));
      EXPECT_THAT(report.outliers, IsEmpty());
      EXPECT_NEAR(report.changes[0].before, 1, 0.06);
      EXPECT_NEAR(report.changes[0].after, 1.3, 0.06);
    }
  }
}

TEST(Changes, ALongOneEndsWhereItEndsAndTheEndOfAllIsNoOutlier) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    for (const std::size_t frames : {20U, 100U, 200U}) {
      const ChangeReport report =
          find_changes(with_step(30, 30 + frames, 0.3, seed), {0.05, 20 * kValues});
      ASSERT_THAT(places(report), ElementsAre(30, 30 + frames)) << seed;
    }
    for (std::size_t left = 1; left <= 5; ++left) {
      const std::vector<double> values = with_step(20, 24, 0.3, seed);
      const ChangeReport report =
          find_changes(std::span(values).first(24 + left), {0.05, 20 * kValues});
      ASSERT_THAT(places(report), ElementsAre(20, 24)) << seed;
      EXPECT_THAT(report.outliers, IsEmpty());
      EXPECT_THAT(report.at_end, IsEmpty());
    }
  }
}

// A camera most of whose names are wrong: what was before lies within the spread.
TEST(Changes, ANoisyOneEndsWhereItEnds) {
  std::size_t ends = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    std::vector<double> values = with_step(100, 120, 0.6, seed);
    Random random(seed + 100);
    for (std::size_t k = 100; k < 120; ++k) values[k] += random.normal(0, 0.13);
    const ChangeReport report = find_changes(values, {0.05, 20 * kValues});
    ASSERT_THAT(report.changes, SizeIs(1)) << seed;
    EXPECT_EQ(report.changes[0].at, 100U) << seed;
    ends += report.changes[0].end == 120U ? 1U : 0U;
  }
  EXPECT_GE(ends, 18U);  // its last values may be as those before
}

// The object turns on while a projector is off.
TEST(Changes, AfterItsEndSlowMotionIsNone) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    std::vector<double> values = with_step(100, 120, -0.4, seed);
    for (std::size_t k = 100; k < kValues; ++k)
      values[k] += 0.005 * static_cast<double>(std::min<std::size_t>(k - 100, 60));
    EXPECT_THAT(places(find_changes(values, {0.12, 20 * kValues})), ElementsAre(100, 120)) << seed;
  }
}

// A factor of .7 where .75 counts: every second value is back among what noise explains.
TEST(Changes, ASmallStepThatNoiseHidesHereAndThereIsNoOutlier) {
  const std::vector<double> values = {-1.36, -1.30, -1.33, -1.29, -1.29, -1.43, -1.28,
                                      -1.29, -1.73, -1.69, -1.59, -1.67, -1.64};
  const ChangeReport report = find_changes(values, {std::log(1.25), 13 * 40});
  EXPECT_THAT(places(report), ElementsAre(8));
  EXPECT_THAT(report.outliers, IsEmpty());
}

TEST(Changes, TheLastValuesMayBeAChange) {
  std::vector<double> values = noise(0.02, 3);
  values[0] = values[4] = values[298] = values[299] = 2;
  const ChangeReport report = find_changes(values, {0.05, kValues});
  EXPECT_THAT(report.changes, IsEmpty());
  EXPECT_THAT(report.outliers, ElementsAre(0, 4));
  EXPECT_THAT(report.at_end, ElementsAre(298, 299));
}

TEST(Changes, ALampThatBlinksIsSaidEachTime) {
  std::vector<double> values = noise(0.02, 1);
  std::vector<std::size_t> expected;
  for (std::size_t k = 30; k < 60; k += 3) {
    expected.push_back(k);
    if ((k / 3) % 2 != 0) continue;
    for (std::size_t i = k; i < k + 3; ++i) values[i] += 0.3;
  }
  EXPECT_EQ(places(find_changes(values, {0.05, 20 * kValues})), expected);
}

TEST(Changes, AStepThatIsHardlySeenHasNoReturn) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    for (const double size : {0.12, 0.14, 0.16}) {  // 6 to 8 deviations; 5.3 are out
      const ChangeReport report =
          find_changes(with_step(100, kValues, size, seed), {0.05, 20 * kValues});
      EXPECT_LE(report.changes.size(), 1U) << seed;
    }
  }
}

TEST(Changes, OneInTheFirstFramesIsFoundWhereItIs) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    for (std::size_t at = 3; at <= 20; ++at) {
      const ChangeReport report =
          find_changes(with_step(at, kValues, 0.3, seed), {0.05, 20 * kValues});
      ASSERT_THAT(places(report), ElementsAre(at)) << seed;
      EXPECT_NEAR(report.changes[0].before, 1, 0.06);
      EXPECT_NEAR(report.changes[0].after, 1.3, 0.06);
      EXPECT_GT(report.changes[0].spreads, 5);
    }
  }
  // It returns within the first frames.
  EXPECT_THAT(places(find_changes(with_step(4, 8, 0.3, 1), {0.05, 20 * kValues})),
              ElementsAre(4, 8));
}

TEST(Changes, AShortCleanSeriesHasNone) {
  std::size_t outliers = 0;
  for (std::uint64_t seed = 1; seed <= 2000; ++seed) {
    const std::vector<double> values = noise(0.02, seed);
    const ChangeReport report = find_changes(std::span(values).first(60), {0.01, 60 * 40});
    EXPECT_THAT(report.changes, IsEmpty()) << seed;
    outliers += report.outliers.size() + report.at_end.size();
  }
  EXPECT_LE(outliers, 4U);  // spreads of few values are known poorly
}

}  // namespace
}  // namespace pencilscan
