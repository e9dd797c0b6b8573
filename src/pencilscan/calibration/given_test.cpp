#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/calibration/given_values.h"
#include "pencilscan/calibration/sample_input.h"
#include "pencilscan/calibration/scale_deviation.h"
#include "pencilscan/calibration/verdict.h"
#include "pencilscan/core/random.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// Two cameras and a projector with a shifted lens before a wall that is tilted, and a few things
/// that stand before it.
class BeforeAWall : public testing::Test {
 protected:
  BeforeAWall() {
    truth_.cameras = {sample::device_at<Camera>({900, -230, 60}, "cam0", 320, 240, 480),
                      sample::device_at<Camera>({930, 240, 20}, "cam1", 320, 240, 500)};
    truth_.projectors = {sample::device_at<Projector>({1000, 30, -150}, "proj0", 320, 240, 420)};
    truth_.cameras[0].distortion = {-0.08, 0.05, 0, 0, 0};
    truth_.cameras[1].distortion = {-0.06, 0.02, 0, 0, 0};
    truth_.projectors[0].K(1, 2) = 190;
  }

  /// A share of the points lies off the wall; a share of the views is wrong.
  [[nodiscard]] std::vector<Track> tracks(int count, double off_share, double wrong_share) {
    std::vector<Track> tracks;
    while (tracks.size() < static_cast<std::size_t>(count)) {
      const double y = random_.uniform(-260, 260);
      const double z = random_.uniform(-200, 200);
      Vec3 x(-40 + 0.25 * y, y, z);
      if (random_.uniform() < off_share)
        x = Vec3(random_.uniform(20, 200), random_.uniform(-100, 100), random_.uniform(-150, 0));
      add_track(x, wrong_share, tracks);
    }
    return tracks;
  }

  void add_track(const Vec3& x, double wrong_share, std::vector<Track>& tracks) {
    const bool camera_hub = random_.below(2) == 0;
    const std::size_t hub = camera_hub ? random_.below(2) : 2;
    const auto seen = [&](std::size_t d) { return *device_at(truth_, d).project(x); };
    Track track{{{hub, seen(hub), 0.02}}, 0};
    if (!device_at(truth_, hub).contains(seen(hub))) return;
    for (std::size_t d = 0; d < 3; ++d) {
      if ((d < 2) == camera_hub || !device_at(truth_, d).contains(seen(d))) continue;
      Vec2 pixel = seen(d) + Vec2(random_.normal(0, kNoisePx), random_.normal(0, kNoisePx));
      if (random_.uniform() < wrong_share) {
        pixel = Vec2(random_.uniform(0, 319), random_.uniform(0, 239));
      }
      track.views.push_back({d, pixel, kNoisePx});
    }
    if (track.views.size() > 1) tracks.push_back(track);
  }

  /// Cameras' K given, off by `error` of the focal lengths and a pixel per thousandth.
  [[nodiscard]] CalibrationInput input(std::vector<Track> tracks, bool is_given, double error) {
    CalibrationInput input = sample::input_of(truth_, std::move(tracks), false);
    for (std::size_t d = 0; is_given && d < 2; ++d) {
      Device& device = device_at(input.rig, d);
      const double factor = 1 + (d == 0 ? error : -error);
      device.K = device_at(truth_, d).K;
      device.K(0, 0) *= factor;
      device.K(1, 1) *= factor;
      device.K(0, 2) += 1000 * error;
      input.known[d].K = true;
    }
    return input;
  }

  struct Judged {
    CalibrationResult result;
    Uncertainty sigma;
    Verdict verdict;
    [[nodiscard]] std::string findings() const {
      std::string all;
      for (const Finding& finding : verdict.findings) all += finding.what + "\n";
      return all;
    }
  };
  static Judged judged(const CalibrationInput& input, const GivenTolerance& tolerance = {}) {
    Judged judged{calibrate(input, {.hypotheses = 2, .tolerance = tolerance}), {}, {}};
    judged.sigma.devices.resize(3);
    if (judged.result.solved)
      judged.sigma = uncertainty(judged.result.problem, judged.result.adjustment);
    judged.verdict = judge(input, judged.result, judged.sigma, {});
    return judged;
  }

  static constexpr double kNoisePx = 0.1;
  Rig truth_;
  Random random_{7};
};

constexpr double kOffTheWall = 0.12;
constexpr double kWrongCodes = 0.05;
constexpr double kGivenError = 0.001;

TEST_F(BeforeAWall, GivenKAndAFewPointsOffTheWallTieARig) {
  const CalibrationInput given = input(tracks(800, kOffTheWall, kWrongCodes), true, kGivenError);
  const Judged found = judged(given);
  ASSERT_TRUE(found.result.solved);
  EXPECT_NE(found.verdict.grade, Grade::kUnusable) << found.findings();
  EXPECT_LT(found.result.rms_px, 0.2);  // 0.1 px in each coordinate
  EXPECT_LT(sample::projection_error(truth_, found.result.problem), 0.3);
  for (std::size_t d = 0; d < 2; ++d) {
    EXPECT_NE(found.result.given[d], GivenUse::kContradicted);
    for (const double moved :
         moved_deviations(device_at(given.rig, d), {}, found.result.problem.devices[d]))
      EXPECT_LT(moved, 2);
  }
  const double focal = found.result.rig.projectors[0].K(0, 0);
  EXPECT_LT(std::abs(focal - 420), 3 * found.sigma.devices[2].inner[kFx]);
  EXPECT_THAT(found.findings(), HasSubstr("given K were kept"));
}

TEST_F(BeforeAWall, WithoutKItIsUnusableAndTheWallIsTheReason) {
  const Judged found = judged(input(tracks(800, kOffTheWall, kWrongCodes), false, 0));
  EXPECT_EQ(found.verdict.grade, Grade::kUnusable);
  EXPECT_THAT(found.findings(), HasSubstr("one plane explains"));
}

TEST_F(BeforeAWall, WithoutAnythingOffTheWallItIsNeverGoodEvenWithK) {
  const Judged found = judged(input(tracks(500, 0, 0), true, 0));
  EXPECT_NE(found.verdict.grade, Grade::kGood);
  EXPECT_THAT(found.findings(), HasSubstr("one plane explains"));
}

TEST_F(BeforeAWall, AKThatTheDataContradictIsNamed) {
  const CalibrationInput wrong = input(tracks(600, 1, 0), true, 0.15);
  const Judged found = judged(wrong);
  ASSERT_TRUE(found.result.solved);
  EXPECT_THAT(found.findings(), HasSubstr("the data contradict the given K of cam"));
  EXPECT_NE(found.verdict.grade, Grade::kGood);
}

TEST_F(BeforeAWall, AToleranceOfZeroHoldsExactly) {
  const CalibrationInput given = input(tracks(600, 0.5, 0), true, 0);
  const Judged found = judged(given, {0, 0});
  ASSERT_TRUE(found.result.solved);
  for (std::size_t d = 0; d < 2; ++d)
    EXPECT_EQ(found.result.rig.cameras[d].K, given.rig.cameras[d].K) << d;
  EXPECT_THAT(found.findings(), HasSubstr("given K were kept exactly"));
}

/// What cannot move shows nothing by itself.
TEST_F(BeforeAWall, AWrongKThatIsStatedExactlyIsNamed) {
  for (const GivenTolerance tolerance : {GivenTolerance{0, 0}, GivenTolerance{0, 5}}) {
    const Judged found = judged(input(tracks(600, 1, 0), true, 0.15), tolerance);
    ASSERT_TRUE(found.result.solved);
    EXPECT_THAT(found.findings(), HasSubstr("the data contradict the given K of cam"));
    EXPECT_THAT(found.findings(), HasSubstr("and was stated exactly as"));
    EXPECT_NE(found.verdict.grade, Grade::kGood);
  }
}

TEST_F(BeforeAWall, TheSkewOfAGivenKIsKept) {
  truth_.cameras[0].K(0, 1) = 15;  // seven pixels at the upper and the lower edge
  const CalibrationInput given = input(tracks(600, 0.5, 0), true, 0);
  const auto result = calibrate(given, {.hypotheses = 2, .tolerance = {0, 0}});
  ASSERT_TRUE(result.solved);
  EXPECT_EQ(result.rig.cameras[0].K, given.rig.cameras[0].K);
  EXPECT_EQ(result.given[0], GivenUse::kExact);
  EXPECT_LT(result.rms_px, 0.2);  // 0.1 px in each coordinate
  EXPECT_LT(sample::projection_error(truth_, result.problem), 0.3);
}

/// What the rig makes of lengths in the volume, as a share too much.
double scale_error(const Rig& truth, const BundleProblem& found) {
  const auto [a, b] = sample::points_of_both(truth, found);
  return fit_similarity(a, b, true).block<3, 1>(0, 0).norm() - 1;
}

/// A ring takes up focal lengths that are wrong alike: that they agree with the data proves little.
TEST(GivenK, ThatAreWrongAlikeStayInTheDeviationOfTheScale) {
  const Rig truth = sample::ring(4, 4);
  CalibrationInput input = sample::input_of(truth, sample::tracks_of(truth, {.count = 1500}), true);
  for (Camera& camera : input.rig.cameras) {
    camera.K(0, 0) *= 0.9974;
    camera.K(1, 1) *= 0.9974;
    camera.K(0, 2) -= 1.5;
    camera.K(1, 2) += 2;
  }
  const auto result = calibrate(input, {.hypotheses = 2});
  ASSERT_TRUE(result.solved);
  const Uncertainty sigma = uncertainty(result.problem, result.adjustment);
  const auto scale = scale_deviation(input, result, sigma);
  ASSERT_TRUE(scale.has_value());
  for (std::size_t d = 0; d < truth.cameras.size(); ++d) {
    EXPECT_EQ(result.given[d], GivenUse::kTolerance);
    const double focal = truth.cameras[d].K(0, 0);
    EXPECT_LT(std::abs(result.rig.cameras[d].K(0, 0) - focal), 2 * sigma.devices[d].inner[kFx]);
  }
  EXPECT_LT(std::abs(scale_error(truth, result.problem)), 2 * scale->share);
}

/// Half of the variance of given K does not average out, however many they are.
TEST(GivenK, OfManyCamerasDoNotGiveAScaleThatMuchBetter) {
  const Rig truth = sample::ring(4, 4);
  const CalibrationInput input =
      sample::input_of(truth, sample::tracks_of(truth, {.count = 1500}), true);
  auto result = calibrate(input, {.hypotheses = 2});
  ASSERT_TRUE(result.solved);
  const auto share = [&] {
    return scale_deviation(input, result, uncertainty(result.problem, result.adjustment))->share;
  };
  const double of_common = share();
  for (BundleDevice& device : result.problem.devices) device.is_K_given = false;
  EXPECT_GT(of_common, 1.1 * share());
}

/// Cameras whose K is given, found without error; then stated otherwise.
class GivenRing : public testing::Test {
 protected:
  GivenRing() : input_(sample::input_of(truth_, {}, true)) {
    for (std::size_t d = 0; d < device_count(truth_); ++d) {
      BundleDevice device = bundle_device(device_at(truth_, d));
      device.present = true;
      set_priors(input_.known[d], GivenTolerance{}, d < kCameras, device);
      found_.problem.devices.push_back(device);
      found_.given.push_back(d < kCameras ? GivenUse::kTolerance : GivenUse::kNone);
    }
    found_.solved = true;
    found_.rig = truth_;
    found_.placed.assign(device_count(truth_), 1);
    found_.residuals.resize(device_count(truth_));
  }

  /// The first cameras' focal lengths are stated too large, by so many tolerances.
  void overstate(std::size_t cameras, double tolerances) {
    for (std::size_t d = 0; d < cameras; ++d) {
      const double factor = 1 / (1 - tolerances * GivenTolerance{}.focal);
      input_.rig.cameras[d].K(0, 0) *= factor;
      input_.rig.cameras[d].K(1, 1) *= factor;
    }
  }
  [[nodiscard]] std::string findings() const {
    Uncertainty sigma;
    sigma.devices.resize(device_count(truth_));
    sigma.devices.back().inner[kFx] = focal_sigma_ * truth_.projectors.back().K(0, 0);
    std::string all;
    for (const Finding& finding : judge(input_, found_, sigma, {}).findings)
      if (finding.grade == Grade::kDoubtful) all += finding.what + "\n";
    return all;
  }

  static constexpr std::size_t kCameras = 4;
  double focal_sigma_ = 0;  ///< of the last projector, over its focal length
  Rig truth_ = sample::ring(kCameras, kCameras);
  CalibrationInput input_;
  CalibrationResult found_;
};

TEST_F(GivenRing, OneKMayBeOffByTwoTolerances) {
  overstate(1, 2.4);
  EXPECT_FALSE(is_any_pulled(input_, {}, found_.problem));
  EXPECT_THAT(findings(), Not(HasSubstr("given K")));
}

/// Cameras whose K is given to 0.5 % cannot give a projector's better.
TEST_F(GivenRing, TheToleranceOfGivenKIsNoWeaknessOfTheData) {
  focal_sigma_ = std::hypot(GivenTolerance{}.focal, 0.001);
  EXPECT_THAT(findings(), Not(HasSubstr("known weakly")));
  focal_sigma_ = std::hypot(GivenTolerance{}.focal, 0.006);
  EXPECT_THAT(findings(), HasSubstr("known weakly"));
  found_.given.assign(found_.given.size(), GivenUse::kNone);
  focal_sigma_ = 0.0051;
  EXPECT_THAT(findings(), HasSubstr("known weakly"));
}

/// Before a plane a rig with a wrong K fits as well as the right one.
TEST_F(GivenRing, APlaneThatDeterminesNoRigContradictsNoK) {
  overstate(1, 5);
  focal_sigma_ = 0.1;
  EXPECT_THAT(findings(), HasSubstr("the data contradict the given K of cam0"));
  found_.pairs.resize(1);
  found_.pairs[0].inliers = 100;
  found_.pairs[0].planar_share = 0.9;
  EXPECT_THAT(findings(), Not(HasSubstr("contradict the given K")));
}

/// Each alone would pass, and a ring with all focal lengths wrong alike fits its data.
TEST_F(GivenRing, AllKAreNotOffByTwoTolerances) {
  overstate(kCameras, 2.4);
  EXPECT_TRUE(is_any_pulled(input_, {}, found_.problem));
  EXPECT_THAT(findings(), HasSubstr("the data contradict the given K together"));
}

/// A board whose squares are no squares stretches everything, and the pixels of the cameras.
TEST_F(GivenRing, AGivenKDoesNotExcusePixelsThatAreNotSquare) {
  EXPECT_THAT(findings(), Not(HasSubstr("fy / fx")));
  found_.problem.devices[0].inner[kFy] *= 1.009;
  EXPECT_THAT(findings(), HasSubstr("fy / fx of cam0 lies 4.5 standard deviations"));
}

}  // namespace
}  // namespace pencilscan
