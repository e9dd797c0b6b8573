#include "pencilscan/calibration/rig_frame.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/calibration/sample_input.h"
#include "pencilscan/calibration/verdict.h"

namespace pencilscan {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

/// A ring found without error, in a frame and a unit of nobody.
class FrameOfAKnownRing : public testing::Test {
 protected:
  FrameOfAKnownRing() {
    input_.rig = truth_;
    input_.known.resize(device_count(truth_));
    problem_.devices = sample::placed_devices(truth_);
    move_solution(0.01, look_at({5, -3, 2}, {1, 1, 1}), problem_);
  }

  /// Poses of the first devices are given, with lengths times `factor`.
  void give_poses(std::size_t count, double factor = 1) {
    input_.rig = scaled(truth_, factor);
    for (std::size_t d = 0; d < count; ++d) input_.known[d].pose = true;
  }
  void measure(double factor) {
    const double mm = (device_at(truth_, 0).center() - device_at(truth_, 1).center()).norm();
    input_.distance = KnownDistance{0, 1, factor * mm};
  }

  /// How far the farthest device is from where the truth, times `factor`, has it.
  [[nodiscard]] double miss(double factor = 1) const {
    double worst = 0;
    for (std::size_t d = 0; d < problem_.devices.size(); ++d)
      worst = std::max(
          worst, (center_of(problem_.devices[d]) - factor * device_at(truth_, d).center()).norm());
    return worst;
  }

  static constexpr double kRoundingMm = 1e-6;
  Rig truth_ = sample::ring(3, 3);
  CalibrationInput input_;
  BundleProblem problem_;
};

TEST_F(FrameOfAKnownRing, GivenPosesGiveFrameAndScale) {
  give_poses(3);
  const FixedFrame frame = fix_frame(input_, problem_);
  EXPECT_TRUE(frame.is_given && frame.is_scaled && !frame.contradicts_given);
  EXPECT_EQ(frame.of_given, 1);
  EXPECT_LT(miss(), kRoundingMm);
}

/// Centres in a line leave the rig free to turn about it: their axes tell.
TEST_F(FrameOfAKnownRing, PosesOnABarGiveTheFrameToo) {
  for (std::size_t d = 0; d < 3; ++d) {
    RigidTransform& pose = device_at(truth_, d).device_from_world;
    pose.translation = -(pose.rotation * Vec3(900, 250.0 * static_cast<double>(d), 100));
  }
  problem_.devices = sample::placed_devices(truth_);
  move_solution(0.01, look_at({5, -3, 2}, {1, 1, 1}), problem_);
  give_poses(3);
  EXPECT_TRUE(fix_frame(input_, problem_).is_given);
  EXPECT_LT(miss(), kRoundingMm);
}

TEST_F(FrameOfAKnownRing, ADistanceThatAgreesLeavesGivenMillimetres) {
  give_poses(3);
  measure(1.02);
  const FixedFrame frame = fix_frame(input_, problem_);
  EXPECT_FALSE(frame.contradicts_given);
  EXPECT_EQ(frame.of_given, 1);
  EXPECT_LT(miss(), 0.03 * 1100);  // the devices stand about 1100 mm from the middle
}

TEST_F(FrameOfAKnownRing, ADistanceInCentimetresContradictsGivenMillimetres) {
  give_poses(3);
  measure(0.1);
  const FixedFrame frame = fix_frame(input_, problem_);
  EXPECT_TRUE(frame.contradicts_given);
  EXPECT_NEAR(frame.of_given, 0.1, 1e-9);
  EXPECT_LT(miss(0.1), kRoundingMm);
}

/// What is too much of exact poses is not of those that miss each other by a tenth.
TEST_F(FrameOfAKnownRing, RoughPosesContradictADistanceLater) {
  for (const double rough : {0.0, 0.1}) {
    give_poses(5);
    measure(1.08);
    for (std::size_t d = 0; d < 5; ++d) {
      const double factor = 1 + (d % 2 == 0 ? rough : -rough);
      device_at(input_.rig, d).device_from_world.translation *= factor;
    }
    BundleProblem problem = problem_;
    EXPECT_EQ(fix_frame(input_, problem).contradicts_given, rough == 0);
  }
}

TEST_F(FrameOfAKnownRing, ADistanceTurnsPosesOfAnUnknownUnitIntoMillimetres) {
  give_poses(3, 0.001);
  input_.rig.unit_known = false;
  measure(1);
  const FixedFrame frame = fix_frame(input_, problem_);
  EXPECT_TRUE(frame.is_scaled && !frame.contradicts_given);
  EXPECT_NEAR(frame.of_given, 1000, 1e-6);
  EXPECT_LT(miss(), kRoundingMm);
}

TEST_F(FrameOfAKnownRing, SoDoesABoard) {
  give_poses(3, 0.001);
  input_.rig.unit_known = false;
  move_solution(100, {}, problem_);  // in the board's millimetres
  problem_.board_poses.emplace_back();
  problem_.board_views.emplace_back();
  const FixedFrame frame = fix_frame(input_, problem_);
  EXPECT_NEAR(frame.of_given, 1000, 1e-6);
  EXPECT_LT(miss(), kRoundingMm);
}

TEST_F(FrameOfAKnownRing, ADistanceThatABoardContradictsIsTold) {
  move_solution(100, {}, problem_);  // in the board's millimetres
  problem_.board_poses.emplace_back();
  problem_.board_views.emplace_back();
  for (const std::size_t poses : {0U, 3U}) {
    give_poses(poses);
    measure(1.02);
    BundleProblem problem = problem_;
    EXPECT_FALSE(fix_frame(input_, problem).of_board);
    measure(1.11);
    problem = problem_;
    const FixedFrame frame = fix_frame(input_, problem);
    ASSERT_TRUE(frame.of_board) << poses;
    EXPECT_NEAR(*frame.of_board, 1.11, 1e-9);
  }
}

TEST_F(FrameOfAKnownRing, TwoPosesDoNotTellIt) {
  give_poses(2);
  EXPECT_FALSE(fix_frame(input_, problem_).is_given);
}

/// Three cameras and projectors; the devices file states a volume and a floor.
CalibrationInput with_volume(std::size_t poses) {
  const Rig truth = sample::ring(3, 3);
  CalibrationInput input = sample::input_of(truth, sample::tracks_of(truth, {.count = 500}), true);
  input.rig.volume = Sphere{Vec3(10, 0, 0), 170};
  input.rig.floor = Floor{Vec3(0, 0, -150), Vec3::UnitZ()};
  for (std::size_t d = 0; d < poses; ++d) {
    input.known[d].pose = true;
    device_at(input.rig, d).device_from_world = device_at(truth, d).device_from_world;
  }
  return input;
}

Verdict judged(const CalibrationInput& input, const CalibrationResult& result) {
  Uncertainty sigma;
  sigma.devices.resize(device_count(input.rig));
  return judge(input, result, sigma, {});
}

std::string all_findings(const Verdict& verdict) {
  std::string all;
  for (const Finding& finding : verdict.findings) all += finding.what + "\n";
  return all;
}

TEST(Calibrate, ADistanceThatContradictsGivenPosesIsNamedAndScalesVolumeAndFloorAlike) {
  CalibrationInput input = with_volume(3);
  input.distance->mm /= 10;
  const auto result = calibrate(input, {.hypotheses = 2});
  ASSERT_TRUE(result.solved);
  const double share =
      result.rig.cameras[2].center().norm() / sample::ring(3, 3).cameras[2].center().norm();
  EXPECT_NEAR(share, 0.1, 0.001);
  EXPECT_NEAR(result.rig.volume->radius, 17, 0.2);
  EXPECT_NEAR(result.rig.floor->point.z(), -15, 0.2);
  const Verdict verdict = judged(input, result);
  EXPECT_EQ(verdict.grade, Grade::kDoubtful);
  EXPECT_THAT(all_findings(verdict),
              AllOf(HasSubstr("the known distance and the given poses contradict each other"),
                    HasSubstr("the known distance is probably in centimetres")));
}

TEST(Judge, ADistanceThatTheBoardContradictsIsNamed) {
  const CalibrationInput input = with_volume(0);
  CalibrationResult result = calibrate(input, {.hypotheses = 2});
  EXPECT_THAT(all_findings(judged(input, result)), Not(HasSubstr("contradict each other")));
  result.board_times = 10;
  const Verdict verdict = judged(input, result);
  EXPECT_EQ(verdict.grade, Grade::kDoubtful);
  EXPECT_THAT(all_findings(verdict),
              AllOf(HasSubstr("the known distance and the board contradict each other"),
                    HasSubstr("the board is probably in centimetres")));
}

TEST(Judge, AVolumeThatIsFarLargerThanWhatWasMeasuredIsANote) {
  CalibrationInput input = with_volume(0);
  const CalibrationResult result = calibrate(input, {.hypotheses = 2});
  ASSERT_TRUE(result.rig.unit_known);
  const auto note = HasSubstr("the unit of the lengths is another");
  EXPECT_THAT(all_findings(judged(input, result)), Not(note));
  input.rig.volume->radius = 1700;  // as where a distance was given in centimetres
  const Verdict verdict = judged(input, result);
  EXPECT_THAT(all_findings(verdict), note);
  EXPECT_EQ(verdict.grade, judged(with_volume(0), result).grade);
}

TEST(Calibrate, VolumeAndFloorStayInTheGivenFrameAndAreLeftOutOfAnother) {
  const auto in_given = calibrate(with_volume(3), {.hypotheses = 2});
  EXPECT_EQ(in_given.rig.volume->radius, 170);
  EXPECT_EQ(in_given.rig.floor->point.z(), -150);
  const CalibrationInput input = with_volume(2);
  const auto in_own = calibrate(input, {.hypotheses = 2});
  ASSERT_TRUE(in_own.solved);
  EXPECT_FALSE(in_own.rig.volume || in_own.rig.floor);
  EXPECT_THAT(all_findings(judged(input, in_own)),
              HasSubstr("volume and floor of the devices file were left out"));
}

}  // namespace
}  // namespace pencilscan
