#include "pencilscan/calibration/scale_deviation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "pencilscan/calibration/calibration_report.h"
#include "pencilscan/calibration/sample_input.h"
#include "pencilscan/calibration/track_errors.h"

namespace pencilscan {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using namespace sample;

/// A wide lens near the volume, a long one far from it, two projectors.
Rig near_and_far() {
  Rig rig;
  const auto place = [](const char* name, double azimuth, double distance, double focal,
                        Device& device) {
    const Vec3 direction(std::cos(azimuth), std::sin(azimuth), 0.3);
    device.name = name;
    device.device_from_world = look_at(distance * direction.normalized(), Vec3::Zero());
    device.width = 1280;
    device.height = 960;
    device.K << focal, 0, 639.5, 0, focal, 479.5, 0, 0, 1;
  };
  rig.cameras.resize(2);
  rig.projectors.resize(2);
  place("cam0", 0, 480, 1040, rig.cameras[0]);
  place("cam1", 1.2, 3500, 9000, rig.cameras[1]);
  place("proj0", 0.5, 800, 1400, rig.projectors[0]);
  place("proj1", 1.6, 820, 1400, rig.projectors[1]);
  return rig;
}

constexpr BundleOptions kFocalLengths{.free_inner = 1U << kFx | 1U << kFy, .max_iterations = 100};

/// The rig found again from correspondences with errors, focal lengths unknown.
CalibrationResult found(const CalibrationInput& input, const Rig& truth) {
  CalibrationResult result;
  result.solved = true;
  result.rig = truth;
  result.rig.unit_known = true;
  for (std::size_t d = 0; d < device_count(truth); ++d) {
    result.problem.devices.push_back(bundle_device(device_at(truth, d)));
    BundleDevice& device = result.problem.devices.back();
    device.present = true;
    device.prior_sigma.fill(0);
    device.prior_sigma[kFx] = std::numeric_limits<double>::infinity();
    device.prior_sigma[kFy] = 1e-6;
  }
  result.problem.tracks = input.tracks;
  triangulate_all(result.problem, kLeastAngle);
  result.adjustment = kFocalLengths;
  adjust(result.problem, kFocalLengths);
  result.placed.assign(device_count(truth), 1);
  result.residuals.resize(device_count(truth));
  result.given.assign(device_count(truth), GivenUse::kNone);
  return result;
}

CalibrationInput input_with_noise(const Rig& truth, std::uint64_t noise_seed) {
  return input_of(
      truth,
      tracks_of(truth, {.count = 300, .noise_px = 0.3, .radius = 100, .noise_seed = noise_seed}),
      false);
}

/// Logarithm of the volume's size over the distance of two devices.
double log_size(const BundleProblem& problem, std::size_t a, std::size_t b) {
  Vec3 middle = Vec3::Zero();
  double count = 0;
  for (std::size_t t = 0; t < problem.points.size(); ++t) {
    if (problem.used[t] == 0) continue;
    middle += problem.points[t];
    ++count;
  }
  middle /= count;
  double squares = 0;
  for (std::size_t t = 0; t < problem.points.size(); ++t)
    if (problem.used[t] != 0) squares += (problem.points[t] - middle).squaredNorm();
  return std::log(std::sqrt(squares) /
                  (center_of(problem.devices[a]) - center_of(problem.devices[b])).norm());
}

/// Sampling: the same points, other errors.
TEST(ScaleDeviation, IsTheScatterOfLengthsOverTheGivenDistance) {
  constexpr int kRuns = 40;  // tell a scatter to a ninth
  const Rig truth = near_and_far();
  for (const std::size_t b : {1U, 2U}) {
    double sum = 0;
    double squares = 0;
    double shares = 0;
    for (int run = 0; run < kRuns; ++run) {
      CalibrationInput input = input_with_noise(truth, static_cast<std::uint64_t>(10 + run));
      input.distance->b = b;
      const CalibrationResult result = found(input, truth);
      const double size = log_size(result.problem, 0, b);
      sum += size / kRuns;
      squares += size * size / kRuns;
      const auto scale =
          scale_deviation(input, result, uncertainty(result.problem, result.adjustment));
      ASSERT_TRUE(scale);
      shares += scale->share / kRuns;
    }
    const double scatter = std::sqrt(squares - sum * sum);
    EXPECT_GT(shares, 0.75 * scatter) << b;
    EXPECT_LT(shares, 1.6 * scatter) << b;  // errors that neighbours may share are in it
  }
}

TEST(ScaleDeviation, OfAWeakScaleIsInTheVerdictWithThePairThatGivesABetterOne) {
  const Rig truth = near_and_far();
  const CalibrationInput input = input_with_noise(truth, 4);
  const CalibrationResult result = found(input, truth);
  const Uncertainty sigma = uncertainty(result.problem, result.adjustment);
  const auto scale = scale_deviation(input, result, sigma);
  const auto best = best_distance(result, sigma);
  ASSERT_TRUE(scale && best);
  EXPECT_GT(scale->share, VerdictOptions{}.good_scale_sigma);
  EXPECT_LT(best->share, 0.5 * scale->share);
  const auto findings = [&](const CalibrationInput& given) {
    std::string all;
    for (const Finding& finding : judge(given, result, sigma, {}).findings)
      if (finding.grade == Grade::kDoubtful) all += finding.what + ": " + finding.advice + "\n";
    return all;
  };
  const std::string a = device_at(truth, best->devices[0]).name;
  const std::string b = device_at(truth, best->devices[1]).name;
  EXPECT_THAT(findings(input), HasSubstr("by the distance of cam0 and cam1"));
  EXPECT_THAT(findings(input), HasSubstr("give --known-distance of " + a + " and " + b));
  CalibrationInput better = input;
  better.distance->a = best->devices[0];
  better.distance->b = best->devices[1];
  EXPECT_THAT(findings(better), Not(HasSubstr("give --known-distance")));

  const Verdict verdict = judge(input, result, sigma, {});
  const LoopClosure loop;
  const auto json =
      calibration_json(CalibrationReport{input, result, sigma, verdict, {}, loop, {}});
  EXPECT_EQ(json["scale"]["from"], "known_distance");
  EXPECT_EQ(json["scale"]["devices"], (std::vector<std::string>{"cam0", "cam1"}));
  EXPECT_NEAR(json["scale"]["length_sigma_percent"].get<double>(), 100 * scale->share, 1e-9);
  EXPECT_EQ(json["scale"]["best_distance"]["devices"], (std::vector<std::string>{a, b}));
}

/// Poses that miss by as much as coordinates of a thousandth of their spread.
TEST(ScaleDeviation, OfGivenPosesHoldsHowFarTheyMiss) {
  const Rig truth = near_and_far();
  CalibrationInput input = input_with_noise(truth, 4);
  input.distance.reset();
  input.rig = truth;
  for (GivenCalibration& known : input.known) known.pose = true;
  const CalibrationResult result = found(input, truth);
  const Uncertainty sigma = uncertainty(result.problem, result.adjustment);
  input.rig = result.rig;
  for (std::size_t d = 0; d < 4; ++d)
    set_device(result.problem.devices[d], device_at(input.rig, d));
  const auto exact = scale_deviation(input, result, sigma);
  for (std::size_t d = 0; d < 4; ++d)
    device_at(input.rig, d).device_from_world.translation +=
        (d % 2 == 0 ? 30 : -30) * Vec3::UnitZ();
  const auto rough = scale_deviation(input, result, sigma);
  ASSERT_TRUE(exact && rough);
  EXPECT_EQ(exact->from, ScaleDeviation::From::kPoses);
  EXPECT_EQ(exact->devices.size(), 4U);
  EXPECT_GT(exact->share, 0);
  double spread = 0;
  for (std::size_t d = 0; d < 4; ++d) spread += center_of(result.problem.devices[d]).squaredNorm();
  EXPECT_GT(rough->share, std::hypot(exact->share, 60 / std::sqrt(5 * spread)));
}

}  // namespace
}  // namespace pencilscan
