#include "pencilscan/recording/frame_sets.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>

#include "pencilscan/core/random.h"

namespace pencilscan {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr double kPeriod = 40e6;  // 25 pictures a second

/// Cameras before a trigger, with all that can go wrong.
struct Trigger {
  struct Of {
    double shift_ns = 0;
    double drift_ppm = 0;
    double phase_ns = 0;                 ///< its shutter opens so much later
    std::vector<std::size_t> dropped;    ///< moments; its rows count on
    std::map<std::size_t, double> late;  ///< moment -> ns
  };
  std::vector<Of> cameras{6};
  std::size_t moments = 300;
  double jitter_ns = 20e3;
  double exposure_us = 4000;

  /// Row -> moment of every camera, for the truth.
  std::vector<std::vector<std::size_t>> moment_of_row;

  std::vector<ShotTimes> shots() {
    Random random(1);
    std::vector<ShotTimes> result;
    moment_of_row.assign(cameras.size(), {});
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      const Of& camera = cameras[c];
      ShotTimes shots;
      shots.exposure_us = exposure_us;
      for (std::size_t k = 0; k < moments; ++k) {
        const double jitter = random.normal(0, jitter_ns);
        if (std::count(camera.dropped.begin(), camera.dropped.end(), k) > 0) continue;
        const auto late = camera.late.find(k);
        const double t = 1e12 + kPeriod * static_cast<double>(k) + jitter + camera.phase_ns +
                         (late == camera.late.end() ? 0 : late->second);
        shots.times_ns.push_back(std::llround(
            t + camera.shift_ns + 1e-6 * camera.drift_ppm * kPeriod * static_cast<double>(k)));
        shots.valid.push_back(1);
        moment_of_row[c].push_back(k);
      }
      result.push_back(std::move(shots));
    }
    return result;
  }

  /// Sets that hold pictures of different moments.
  std::size_t mixed(const FrameSets& sets) const {
    std::size_t count = 0;
    for (const FrameSet& set : sets.sets) {
      std::optional<std::size_t> moment;
      bool is_mixed = false;
      for (std::size_t c = 0; c < set.rows.size(); ++c) {
        if (!set.rows[c]) continue;
        const std::size_t of = moment_of_row[c][*set.rows[c]];
        is_mixed = is_mixed || (moment && *moment != of);
        moment = of;
      }
      count += is_mixed;
    }
    return count;
  }
};

TEST(FrameSets, RowsThatAreMomentsStayRows) {
  Trigger trigger;
  const FrameSets sets = group_frames(trigger.shots());
  EXPECT_TRUE(sets.by_row);
  EXPECT_EQ(sets.sets.size(), 300U);
  EXPECT_NEAR(sets.period_ns, kPeriod, 1e5);
  EXPECT_THAT(sets.gaps, IsEmpty());
  for (const CameraClock& clock : sets.clocks) {
    EXPECT_TRUE(clock.shared);
    EXPECT_THAT(clock.dropped, IsEmpty());
    EXPECT_THAT(clock.late, IsEmpty());
    EXPECT_NEAR(clock.drift_ppm, 0, 5);
  }
  EXPECT_LT(sets.sets[17].spread_ns, 3e5);
}

TEST(FrameSets, DroppedPicturesAreNamedAndNothingElseShifts) {
  Trigger trigger;
  trigger.cameras[2].dropped = {10, 11, 150};
  trigger.cameras[4].dropped = {11};
  const FrameSets sets = group_frames(trigger.shots());
  EXPECT_FALSE(sets.by_row);
  EXPECT_EQ(sets.sets.size(), 300U);
  EXPECT_EQ(trigger.mixed(sets), 0U);
  EXPECT_THAT(sets.clocks[2].dropped, ElementsAre(10, 11, 150));
  EXPECT_THAT(sets.clocks[4].dropped, ElementsAre(11));
  EXPECT_THAT(sets.clocks[0].dropped, IsEmpty());
}

TEST(FrameSets, WhatAllCamerasMissIsAGap) {
  Trigger trigger;
  for (Trigger::Of& camera : trigger.cameras) camera.dropped = {20, 21};
  trigger.cameras[1].dropped.push_back(40);
  const FrameSets sets = group_frames(trigger.shots());
  EXPECT_EQ(sets.sets.size(), 298U);
  EXPECT_EQ(trigger.mixed(sets), 0U);
  EXPECT_THAT(sets.gaps, ElementsAre(std::pair<std::size_t, std::size_t>(20, 2)));
}

TEST(FrameSets, WhatAllCamerasMissIsAGapOfRowsToo) {
  Trigger trigger;
  for (Trigger::Of& camera : trigger.cameras) camera.dropped = {20, 21, 50, 51, 52};
  std::vector<ShotTimes> shots = trigger.shots();
  FrameSets sets = group_frames(shots);
  EXPECT_TRUE(sets.by_row);
  EXPECT_THAT(sets.gaps, ElementsAre(std::pair<std::size_t, std::size_t>(20, 2),
                                     std::pair<std::size_t, std::size_t>(48, 3)));
  // Of the three, two are rows without pictures.
  for (ShotTimes& camera : shots) {
    camera.times_ns.insert(camera.times_ns.begin() + 48, 2, kUnknownTime);
    camera.valid.insert(camera.valid.begin() + 48, 2, 0);
  }
  sets = group_frames(shots);
  EXPECT_TRUE(sets.by_row);
  EXPECT_THAT(sets.gaps, ElementsAre(std::pair<std::size_t, std::size_t>(20, 2),
                                     std::pair<std::size_t, std::size_t>(50, 1)));
}

TEST(FrameSets, PicturesWithoutATimeStampAreOfTheMomentBetweenTheirNeighbours) {
  Trigger trigger;
  trigger.cameras[0].dropped = {10};  // rows are not the moments
  std::vector<ShotTimes> shots = trigger.shots();
  const auto forget = [&](std::size_t camera, std::size_t row) {
    shots[camera].times_ns[row] = kUnknownTime;
  };
  forget(0, 30);  // moment 31
  forget(1, 100);
  forget(1, 101);
  forget(2, 299);  // nothing tells whether it is of the last moment
  FrameSets sets = group_frames(shots);
  EXPECT_FALSE(sets.by_row);
  EXPECT_EQ(sets.sets[31].rows[0], 30U);
  EXPECT_EQ(sets.sets[100].rows[1], 100U);
  EXPECT_EQ(sets.sets[101].rows[1], 101U);
  EXPECT_EQ(trigger.mixed(sets), 0U);
  EXPECT_THAT(sets.clocks[0].dropped, ElementsAre(10));
  EXPECT_THAT(sets.clocks[1].dropped, IsEmpty());
  EXPECT_THAT(sets.clocks[1].left_out, IsEmpty());
  EXPECT_THAT(sets.clocks[2].left_out, ElementsAre(299));
  EXPECT_THAT(sets.clocks[2].dropped, ElementsAre(299));
  // One picture for two moments.
  forget(0, 9);
  sets = group_frames(shots);
  EXPECT_THAT(sets.clocks[0].left_out, ElementsAre(9));
  EXPECT_THAT(sets.clocks[0].dropped, ElementsAre(9, 10));
}

TEST(FrameSets, CamerasThatTakeTurnsAreOfTwoMoments) {
  for (const double phase : {0.3, 0.494, 0.506}) {
    Trigger trigger;
    trigger.cameras.resize(4);
    for (const std::size_t c : {2U, 3U}) trigger.cameras[c].phase_ns = phase * kPeriod;
    trigger.cameras[1].dropped = {20};
    trigger.cameras[3].dropped = {40};
    const FrameSets sets = group_frames(trigger.shots());
    ASSERT_EQ(sets.sets.size(), 600U) << phase;
    EXPECT_EQ(trigger.mixed(sets), 0U);
    for (std::size_t k = 0; k < 600; ++k) {
      EXPECT_EQ(sets.sets[k].rows[0].has_value(), k % 2 == 0);
      EXPECT_EQ(sets.sets[k].rows[2].has_value(), k % 2 == 1);
      EXPECT_LT(sets.sets[k].spread_ns, 3e5);
    }
    EXPECT_THAT(sets.clocks[2].late, IsEmpty());
    EXPECT_THAT(sets.gaps, IsEmpty());
  }
}

// Camera 0 takes two pictures while the others take one, in turns.
TEST(FrameSets, APictureIsOfTheNearestMomentOfAFasterCamera) {
  std::vector<ShotTimes> cameras(3);
  const std::vector<double> first = {0, 0.5e6, 39.5e6};
  for (std::size_t c = 0; c < 3; ++c) {
    const double period = c == 0 ? 40e6 : 80e6;
    for (std::size_t k = 0; k < (c == 0 ? 100U : 50U); ++k) {
      cameras[c].times_ns.push_back(
          std::llround(1e12 + first[c] + period * static_cast<double>(k)));
      cameras[c].valid.push_back(1);
    }
  }
  const FrameSets sets = group_frames(cameras);
  ASSERT_EQ(sets.sets.size(), 100U);
  EXPECT_NEAR(sets.period_ns, 40e6, 1e6);
  for (std::size_t k = 0; k < 100; ++k) {
    EXPECT_EQ(sets.sets[k].rows[0], k);
    EXPECT_EQ(sets.sets[k].rows[1].has_value(), k % 2 == 0);
    EXPECT_EQ(sets.sets[k].rows[2].has_value(), k % 2 == 1);
  }
}

TEST(FrameSets, ClocksWithAStartOfTheirOwnAreShiftedOntoEachOther) {
  Trigger trigger;
  trigger.cameras[1].shift_ns = 7200e9;
  trigger.cameras[3].shift_ns = -3e14;
  trigger.cameras[3].drift_ppm = 80;  // 1 ms in 300 pictures
  trigger.cameras[3].dropped = {60};
  trigger.cameras[5].shift_ns = 5e9;
  const FrameSets sets = group_frames(trigger.shots());
  EXPECT_EQ(trigger.mixed(sets), 175U);  // 5 s look like a camera that started later

  std::vector<ShotTimes> said = trigger.shots();
  for (ShotTimes& camera : said) camera.shares_clock = false;
  const FrameSets right = group_frames(said);
  EXPECT_EQ(trigger.mixed(right), 0U);
  EXPECT_FALSE(right.clocks[1].shared);
  EXPECT_NEAR(right.clocks[1].shift_ns, 7200e9, 1e5);
  EXPECT_NEAR(right.clocks[3].shift_ns, -3e14, 5e5);
  EXPECT_NEAR(right.clocks[3].drift_ppm, 80, 20);
  EXPECT_THAT(right.clocks[3].dropped, ElementsAre(60));
  EXPECT_THAT(right.clocks[3].late, IsEmpty());
}

TEST(FrameSets, FreeRunningCamerasAreGroupedByTimeAndLateInAllFrames) {
  Trigger trigger;
  trigger.cameras[2].phase_ns = 15e6;
  trigger.cameras[3].phase_ns = 2 * kPeriod + 3e6;  // its first row is the third moment's
  const FrameSets sets = group_frames(trigger.shots());
  EXPECT_FALSE(sets.by_row);
  EXPECT_TRUE(sets.clocks[3].shared);
  for (std::size_t k = 2; k < 300; ++k) {
    EXPECT_EQ(sets.sets[k].rows[0], k);
    EXPECT_EQ(sets.sets[k].rows[3], k - 2);
  }
  EXPECT_EQ(sets.clocks[2].late.size(), 300U);
  EXPECT_NEAR(sets.clocks[2].shift_ns, 15e6, 1e5);
  EXPECT_NEAR(sets.sets[50].spread_ns, 15e6, 3e5);
}

// Its pictures fall now before and now behind the middle between two moments.
TEST(FrameSets, ACameraHalfAPeriodLateTearsNoOthersApart) {
  for (const std::size_t count : {4U, 6U}) {
    Trigger trigger;
    trigger.cameras.resize(count);
    trigger.cameras.back().phase_ns = kPeriod / 2;
    const FrameSets sets = group_frames(trigger.shots());
    std::size_t whole = 0;
    for (const FrameSet& set : sets.sets) {
      std::size_t of_others = 0;
      std::optional<std::size_t> moment;
      for (std::size_t c = 0; c + 1 < count; ++c) {
        if (!set.rows[c]) continue;
        ++of_others;
        const std::size_t of = trigger.moment_of_row[c][*set.rows[c]];
        EXPECT_TRUE(!moment || *moment == of) << "set " << set.number;
        moment = of;
      }
      EXPECT_TRUE(of_others == 0 || of_others + 1 == count) << "set " << set.number;
      whole += of_others > 0;
    }
    EXPECT_EQ(whole, trigger.moments);
    EXPECT_EQ(sets.sets.size(), trigger.moments);
    EXPECT_EQ(sets.clocks.back().late.size(), trigger.moments);
  }
}

TEST(FrameSets, LatePicturesAreNamed) {
  Trigger trigger;
  trigger.cameras[0].late = {{5, 3e6}, {6, 1e6}};  // the exposure is 4 ms
  FrameSets sets = group_frames(trigger.shots());
  EXPECT_THAT(sets.clocks[0].late, ElementsAre(5));
  EXPECT_NEAR(sets.sets[5].spread_ns, 3e6, 3e5);
  EXPECT_NEAR(sets.sets[5].offset_ns[0], 3e6, 3e5);
  trigger.exposure_us = 0;
  trigger.cameras[0].late = {{5, 3e6}, {6, 12e6}};
  sets = group_frames(trigger.shots());
  EXPECT_THAT(sets.clocks[0].late, ElementsAre(6));
}

TEST(FrameSets, TimesNearBothEndsOfTheirRangeAreInOrder) {
  constexpr std::int64_t kFarthest = std::numeric_limits<std::int64_t>::max() - 1000;
  ShotTimes shots;
  shots.times_ns = {-kFarthest, 0, kFarthest};
  shots.valid = {1, 1, 1};
  const std::vector<ShotTimes> cameras = {shots, shots};
  const FrameSets sets = group_frames(cameras);
  EXPECT_EQ(sets.period_ns, static_cast<double>(kFarthest));
  EXPECT_TRUE(sets.by_row);
  EXPECT_EQ(sets.sets.size(), 3U);
}

TEST(FrameSets, WithoutTimesRowsAreMoments) {
  std::vector<ShotTimes> cameras(2);
  cameras[0].times_ns = {kUnknownTime, kUnknownTime, kUnknownTime};
  cameras[0].valid = {1, 0, 1};
  cameras[1] = cameras[0];
  cameras[1].valid = {1, 1, 1};
  const FrameSets sets = group_frames(cameras);
  EXPECT_TRUE(sets.by_row);
  ASSERT_EQ(sets.sets.size(), 3U);
  EXPECT_FALSE(sets.sets[1].rows[0].has_value());
  EXPECT_EQ(sets.sets[1].rows[1], 1U);
  EXPECT_THAT(sets.clocks[0].dropped, ElementsAre(1));
  EXPECT_FALSE(sets.clocks[0].timed);
}

TEST(FrameSets, WhatHasNoPictureIsNoFrameAndTheOthersKeepTheirNumbers) {
  std::vector<ShotTimes> cameras(2);
  cameras[0].times_ns = {kUnknownTime, kUnknownTime, kUnknownTime, kUnknownTime};
  cameras[1].times_ns = cameras[0].times_ns;
  cameras[0].valid = {1, 0, 1, 0};
  cameras[1].valid = {1, 0, 0, 1};
  FrameSets sets = group_frames(cameras);
  const auto numbers = [&] {
    std::vector<std::size_t> result;
    for (const FrameSet& set : sets.sets) result.push_back(set.number);
    return result;
  };
  EXPECT_THAT(numbers(), ElementsAre(0, 2, 3));
  EXPECT_THAT(sets.no_frame, ElementsAre(1));
  EXPECT_EQ(sets.sets[1].rows[0], 2U);
  EXPECT_THAT(sets.clocks[0].dropped, ElementsAre(3));
  EXPECT_THAT(sets.clocks[1].dropped, ElementsAre(2));

  // Of moments, too: times without a picture, of cameras whose rows are not the moments.
  Trigger trigger;
  trigger.moments = 20;
  trigger.cameras[0].dropped = {3};
  std::vector<ShotTimes> shots = trigger.shots();
  for (std::size_t c = 0; c < shots.size(); ++c) shots[c].valid[c == 0 ? 9 : 10] = 0;
  sets = group_frames(shots);
  EXPECT_FALSE(sets.by_row);
  EXPECT_THAT(sets.no_frame, ElementsAre(10));
  ASSERT_EQ(sets.sets.size(), 19U);
  EXPECT_EQ(sets.sets[10].number, 11U);
  EXPECT_EQ(sets.sets[10].rows[1], 11U);
}

}  // namespace
}  // namespace pencilscan
