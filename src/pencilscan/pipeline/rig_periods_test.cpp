#include "pencilscan/pipeline/rig_periods.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pencilscan/pipeline/sample_frame.h"

namespace pencilscan {
namespace {

using ::testing::HasSubstr;

/// Four cameras and four projectors around an egg: curves of a frame with the rig as it is, and
/// of one with the second camera turned.
class RigPeriods : public ::testing::Test {
 protected:
  static constexpr double kTurnPx = 2;

  static void SetUpTestSuite() {
    rig_ = ring_of(4);
    as_stated_ = curves_of(rig_);
    after_turn_ = curves_of(turned(kTurnPx));
  }
  static void TearDownTestSuite() { as_stated_ = after_turn_ = {}; }

  static Rig ring_of(int devices) {
    RingOptions ring = sample::small_ring();
    ring.cameras = ring.projectors = devices;
    return make_ring(ring);
  }
  static Rig turned(double px) { return turned(rig_, px); }
  static Rig turned(Rig rig, double px) {
    Camera& camera = rig.cameras[1];
    camera.device_from_world = corrected_pose(camera, {Vec3(px, 0, 0), Vec3::Zero()});
    return rig;
  }
  static FrameCurves curves_of(const Rig& rig) {
    TriangleMesh egg = make_sphere(100, 40);
    for (Vec3& vertex : egg.vertices) vertex = vertex.cwiseProduct(Vec3(1, 0.8, 1.3));
    PointResult seen = detect_frame(rig, sample::photographed_frame(rig, SimulatedObject(egg), {}));
    return {std::move(seen.families), std::move(seen.graphs)};
  }

  static inline Rig rig_;
  static inline FrameCurves as_stated_;
  static inline FrameCurves after_turn_;
};

/// Three devices of a kind stand so far apart that the lines of crossings lead into a camera's
/// picture in one direction.
TEST_F(RigPeriods, AMoveThatCrossingsWouldNotShowIsSaid) {
  const Rig rig = ring_of(3);
  const FrameCurves curves = curves_of(rig);
  const auto fits = check_rig_over_frames(rig, {&curves, 1});
  EXPECT_EQ(verdict_of(fits), "fits");
  EXPECT_THAT(fits.front().fit.text, HasSubstr("hardly show a move of camera cam0"));
  EXPECT_TRUE(fits.front().fit.devices[1].may_have_moved_unseen);
  EXPECT_FALSE(fits.front().fit.devices[4].may_have_moved_unseen);
  // So far that crossings meet at the names of other lines.
  const RigFit fit = check_rig_over_frames(turned(rig, 12), {&curves, 1}).front().fit;
  EXPECT_NE(fit.verdict, RigVerdict::kFits) << fit.text;
  EXPECT_NE(fit.verdict, RigVerdict::kUnknown) << fit.text;
}

TEST_F(RigPeriods, WhatStandsStillFitsAndEveryMoveWouldShow) {
  const auto fits = check_rig_over_frames(rig_, {&as_stated_, 1});
  EXPECT_EQ(verdict_of(fits), "fits");
  for (const DeviceFit& device : fits.front().fit.devices) {
    EXPECT_FALSE(device.may_have_moved_unseen) << device.name;
    EXPECT_LT(device.seen_from_px, 1) << device.name;
  }
}

TEST_F(RigPeriods, ACameraThatWasTurnedMeanwhileIsPutBackFromThenOn) {
  const std::vector<FrameCurves> film = {as_stated_, as_stated_, after_turn_};
  const std::vector<std::string> names = {"000000", "000001", "000002"};
  const auto periods = check_rig_over_frames(rig_, film);
  const std::string text = describe_periods(periods, names);
  ASSERT_EQ(periods.size(), 2U) << text;
  EXPECT_EQ(verdict_of(periods), "moved meanwhile") << text;
  EXPECT_EQ(periods[0].last, 1U);
  EXPECT_EQ(periods[0].fit.verdict, RigVerdict::kFits) << text;
  EXPECT_EQ(periods[1].fit.verdict, RigVerdict::kOneMoved) << text;
  EXPECT_TRUE(periods[1].fit.devices[1].has_moved) << text;
  EXPECT_NEAR(periods[1].fit.devices[1].shift_px, kTurnPx, 0.3);
  EXPECT_THAT(text, HasSubstr("in frame 000002, one device is to be put back: camera cam1"));
}

TEST_F(RigPeriods, WhatIsOffAllTheTimeIsOnePeriod) {
  const std::vector<FrameCurves> film = {after_turn_, after_turn_};
  const auto periods = check_rig_over_frames(rig_, film);
  ASSERT_EQ(periods.size(), 1U);
  EXPECT_EQ(verdict_of(periods), "one moved");
}

RigPeriod said(RigVerdict verdict, bool has_moved) {
  RigPeriod period;
  period.fit.verdict = verdict;
  period.fit.devices.resize(2);
  period.fit.devices[1].has_moved = has_moved;
  return period;
}

TEST(VerdictOfPeriods, IsAMoveOnlyWhereOneIsKnown) {
  const RigPeriod fits = said(RigVerdict::kFits, false);
  const RigPeriod moved = said(RigVerdict::kOneMoved, true);
  const RigPeriod unexplained = said(RigVerdict::kUnexplained, false);
  RigPeriod after_move = fits;
  after_move.moved_before.emplace();
  const auto verdict = [](const RigPeriod& a, const RigPeriod& b) {
    return verdict_of(std::vector<RigPeriod>{a, b});
  };
  EXPECT_EQ(verdict(fits, fits), "fits");
  EXPECT_EQ(verdict(fits, moved), "moved meanwhile");
  EXPECT_EQ(verdict(moved, moved), "one moved");
  EXPECT_EQ(verdict(fits, after_move), "moved meanwhile");
  // Names are lost, and nobody knows why.
  EXPECT_EQ(verdict(fits, unexplained), "unexplained");
  EXPECT_EQ(verdict(said(RigVerdict::kUnknown, false), moved), "unknown");
}

}  // namespace
}  // namespace pencilscan
