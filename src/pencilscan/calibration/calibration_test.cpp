#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/bundle/triangulation.h"
#include "pencilscan/calibration/calibrate.h"
#include "pencilscan/calibration/calibration_report.h"
#include "pencilscan/calibration/given_values.h"
#include "pencilscan/calibration/pair_matches.h"
#include "pencilscan/calibration/rig_frame.h"
#include "pencilscan/calibration/sample_input.h"
#include "pencilscan/calibration/track_errors.h"

namespace pencilscan {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using namespace sample;

double projection_error(const Rig& truth, const Rig& found) {
  BundleProblem problem;
  problem.devices = placed_devices(found);
  return sample::projection_error(truth, problem);
}

/// Small scenes need no more, and tests shall be quick.
constexpr CalibrateOptions kQuick{.hypotheses = 2};

TEST(Calibrate, RingIsFoundFromImageSizesDespiteOutliers) {
  const Rig truth = ring(4, 4);
  const auto result =
      calibrate(input_of(truth, tracks_of(truth, {.count = 1000, .outliers = 0.3}), false), kQuick);
  ASSERT_TRUE(result.solved);
  EXPECT_LT(result.rms_px, 0.15);
  for (std::size_t d = 0; d < device_count(truth); ++d) {
    ASSERT_NE(result.placed[d], 0) << d;
    const double focal = device_at(truth, d).K(0, 0);
    // A third of a ring with 900 points: weaker than what is asked of whole rings.
    EXPECT_NEAR(device_at(result.rig, d).K(0, 0) / focal, 1, 0.02) << d;
  }
  EXPECT_TRUE(result.rig.unit_known);
  EXPECT_LT(projection_error(truth, result.rig), 1.0);
}

/// Several captures, the last one of another rig.
std::vector<Track> captures_of(const Rig& truth, const Rig& last, std::size_t captures) {
  std::vector<Track> all;
  for (std::size_t capture = 0; capture < captures; ++capture) {
    const std::uint64_t seed = 10 + 2 * capture;
    for (Track& track : tracks_of(capture + 1 == captures ? last : truth,
                                  {.count = 300, .seed = seed, .noise_seed = seed + 1})) {
      track.capture = capture;
      all.push_back(std::move(track));
    }
  }
  return all;
}

std::vector<Track> mirrored_by(const Rig& rig, std::vector<Track> tracks, std::size_t device) {
  for (Track& track : tracks) {
    for (TrackView& view : track.views)
      if (view.device == device) view.pixel.x() = device_at(rig, device).width - 1 - view.pixel.x();
  }
  return tracks;
}

TEST(Calibrate, ADeviceThatMirrorsItsPictureIsFoundAndARightOneIsNot) {
  const Rig truth = ring(3, 3);
  const auto tracks = tracks_of(truth, {.count = 500});
  EXPECT_FALSE(calibrate(input_of(truth, tracks, true), kQuick).mirrored);
  for (const std::size_t device : {1U, 4U}) {
    const auto input = input_of(truth, mirrored_by(truth, tracks, device), true);
    const auto result = calibrate(input, kQuick);
    ASSERT_TRUE(result.mirrored) << device;
    EXPECT_EQ(result.mirrored->devices, std::vector{device});
    Uncertainty sigma;
    sigma.devices.resize(device_count(truth));
    const Verdict verdict = judge(input, result, sigma, {});
    ASSERT_EQ(verdict.findings.size(), 1U);  // everything else follows from it
    EXPECT_EQ(verdict.grade, Grade::kUnusable);
    EXPECT_THAT(verdict.findings[0].what,
                AllOf(HasSubstr(device_at(truth, device).name), HasSubstr("mirror")));
  }
}

/// Over several captures it looks as if it had moved in each, and the rest fits well without it.
TEST(Calibrate, AMirroredCameraHasNotMovedBetweenCaptures) {
  const Rig truth = ring(3, 3);
  const auto tracks = mirrored_by(truth, captures_of(truth, truth, 3), 1);
  const auto result = calibrate(input_of(truth, tracks, true), kQuick);
  ASSERT_TRUE(result.mirrored);
  EXPECT_EQ(result.mirrored->devices, std::vector<std::size_t>{1});
}

TEST(Calibrate, KnownCamerasAreKeptAndGiveAPreciseRig) {
  const Rig truth = ring(3, 3);
  const auto result = calibrate(input_of(truth, tracks_of(truth, {.count = 500}), true), kQuick);
  ASSERT_TRUE(result.solved);
  for (std::size_t d = 0; d < 3; ++d) {
    EXPECT_NE(result.given[d], GivenUse::kContradicted);
    const BundleDevice& found = result.problem.devices[d];
    for (const double moved : moved_deviations(truth.cameras[d], result.tolerance, found))
      EXPECT_LT(moved, 1) << d;
  }
  EXPECT_LT(result.rms_px, 0.15);
  EXPECT_LT(projection_error(truth, result.rig), 0.15);
}

TEST(Calibrate, FocalLengthsThatAreFivePercentOffAreOnlyAStart) {
  const Rig truth = ring(3, 3);
  CalibrationInput input = input_of(truth, tracks_of(truth, {.count = 1000}), true);
  for (Camera& camera : input.rig.cameras) {
    camera.K(0, 0) *= 1.05;
    camera.K(1, 1) *= 1.05;
  }
  const auto result = calibrate(input, kQuick);
  ASSERT_TRUE(result.solved);
  for (std::size_t d = 0; d < 3; ++d) {
    EXPECT_EQ(result.given[d], GivenUse::kContradicted);
    EXPECT_NEAR(result.rig.cameras[d].K(0, 0) / truth.cameras[d].K(0, 0), 1, 0.025);
  }
}

/// Each agrees with what the data know of it alone.
TEST(Calibrate, FocalLengthsThatAreStatedExactlyAndWrongAlikeAreOnlyAStart) {
  const Rig truth = ring(3, 3);
  for (const double wrong : {0.0, 0.01}) {
    CalibrationInput input = input_of(truth, tracks_of(truth, {.count = 1000}), true);
    for (Camera& camera : input.rig.cameras) {
      camera.K(0, 0) *= 1 + wrong;
      camera.K(1, 1) *= 1 + wrong;
    }
    const auto result = calibrate(input, {.hypotheses = 2, .tolerance = {0, 0}});
    ASSERT_TRUE(result.solved);
    for (std::size_t d = 0; d < 3; ++d)
      EXPECT_EQ(result.given[d] == GivenUse::kContradicted, wrong > 0) << d;
  }
}

TEST(Calibrate, FourPoorGuessesEndInTheSamePlace) {
  const Rig truth = ring(3, 3);
  std::vector<Rig> found;
  for (const double factor : {0.7, 0.85, 1.25, 1.5}) {
    CalibrationInput input = input_of(truth, tracks_of(truth, {.count = 500}), false);
    for (std::size_t d = 0; d < device_count(truth); ++d) {
      const Device& device = device_at(truth, d);
      const double focal = factor * device.K(0, 0) * (1 + 0.02 * static_cast<double>(d % 3));
      device_at(input.rig, d).K << focal, 0, device.width / 2, 0, focal, device.height / 2, 0, 0, 1;
      input.known[d].K = true;
    }
    const auto result = calibrate(input, kQuick);
    ASSERT_TRUE(result.solved) << factor;
    EXPECT_LT(result.rms_px, 0.1) << factor;
    for (std::size_t d = 0; d < device_count(truth); ++d) EXPECT_NE(result.placed[d], 0) << factor;
    found.push_back(result.rig);
  }
  for (std::size_t i = 1; i < found.size(); ++i)
    EXPECT_LT(projection_error(found[0], found[i]), 0.2)
        << i;  // the poorest guess loses some views
}

TEST(Verdict, PlanarSceneIsUnusable) {
  const Rig truth = ring(1, 1);
  const CalibrationInput input =
      input_of(truth, tracks_of(truth, {.count = 400, .planar = true}), false);
  const auto result = calibrate(input, kQuick);
  Uncertainty sigma;
  sigma.devices.resize(2);
  const Verdict verdict = judge(input, result, sigma, {});
  EXPECT_EQ(verdict.grade, Grade::kUnusable);
  std::string all;
  for (const Finding& finding : verdict.findings) all += finding.what + "\n";
  EXPECT_THAT(all, HasSubstr("planar scene"));
}

/// All findings about a ring of four and four devices, cameras known.
std::string findings_of(const Rig& truth, const std::vector<Track>& tracks) {
  const CalibrationInput input = input_of(truth, tracks, true);
  const auto result = calibrate(input, kQuick);
  EXPECT_TRUE(result.solved);
  Uncertainty sigma;
  sigma.devices.resize(device_count(truth));
  std::string all;
  for (const Finding& finding : judge(input, result, sigma, {}).findings)
    all += finding.what + "\n";
  return all;
}

TEST(Verdict, SwappedFoldersAreNamed) {
  const Rig truth = ring(4, 4);
  const auto tracks = with_exchanged(tracks_of(truth, {.count = 1500}), {1, 5}, {2, 5});
  EXPECT_THAT(findings_of(truth, tracks),
              HasSubstr("the folders proj1/cam1 and proj1/cam2 are swapped"));
}

TEST(Verdict, FoldersSwappedInOneCaptureAreNamedWithIt) {
  const Rig truth = ring(4, 4);
  auto tracks = tracks_of(truth, {.count = 1500});
  auto second = tracks_of(truth, {.count = 1500, .seed = 5});
  for (Track& track : second) track.capture = 1;
  second = with_exchanged(second, {1, 5}, {2, 5});
  tracks.insert(tracks.end(), second.begin(), second.end());
  EXPECT_THAT(findings_of(truth, tracks),
              HasSubstr("the folders proj1/cam1 and proj1/cam2 (--captures number 2) are swapped"));
}

/// A camera's folders exchanged for another's: no pair of theirs fits a scene as a whole. Of
/// proj2's pairs one is too little off to be doubted, and the other is told as a camera that moved.
TEST(Verdict, CamerasExchangedInOneCaptureAreNamedAndTheirCodesMakeSense) {
  const Rig truth = ring(3, 3);
  std::vector<Track> tracks = captures_of(truth, truth, 3);
  for (Track& track : tracks)
    for (TrackView& view : track.views)
      if (track.capture == 1 && view.device < 2) view.device = 1 - view.device;
  const std::string all = findings_of(truth, tracks);
  for (const std::string proj : {"proj0", "proj1"})
    EXPECT_THAT(all, HasSubstr("the folders " + proj + "/cam0 and " + proj +
                               "/cam1 (--captures number 2) are swapped"));
  EXPECT_THAT(all, AllOf(Not(HasSubstr("make no sense")), Not(HasSubstr("fit a rigid scene")),
                         Not(HasSubstr("mirror"))));
}

/// In the last capture cam1 is turned by so many pixels about the axis of its frame.
std::vector<Track> tracks_with_a_turn(const Rig& truth, const Vec3& axis, double px,
                                      std::size_t captures = 3) {
  Rig turned = truth;
  const double angle = px / truth.cameras[1].K(0, 0);
  RigidTransform& pose = turned.cameras[1].device_from_world;
  const Mat3 R = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
  pose = {R * pose.rotation, R * pose.translation};
  return captures_of(truth, turned, captures);
}

/// A turn to the side goes along the epipolar lines: no pair of a camera and a projector tells.
TEST(Verdict, ACameraThatMovedBetweenCapturesIsNamed) {
  const Rig truth = ring(3, 3);
  for (const auto& [axis, px] : {std::pair(Vec3(Vec3::UnitY()), 10.0), {Vec3::UnitX(), 2}})
    EXPECT_THAT(findings_of(truth, tracks_with_a_turn(truth, axis, px)),
                AllOf(HasSubstr("camera cam1 has moved, or was zoomed, between captures: in "
                                "--captures number 3"),
                      Not(HasSubstr("camera cam0")), Not(HasSubstr("projector proj"))))
        << axis.transpose() << ", " << px << " px";
}

/// Which of two captures is the odd one nobody knows.
TEST(Verdict, OfTwoCapturesNeitherIsAccused) {
  const Rig truth = ring(3, 3);
  const std::string all = findings_of(truth, tracks_with_a_turn(truth, Vec3::UnitY(), 10, 2));
  EXPECT_THAT(all,
              HasSubstr("camera cam1 has moved, or was zoomed, between captures: its picture"));
  EXPECT_THAT(all, HasSubstr("two captures do not tell where it usually stands"));
  EXPECT_THAT(all, Not(HasSubstr("off where the rig has it")));
}

TEST(Verdict, NothingMovedWhereNothingDid) {
  const Rig truth = ring(3, 3);
  EXPECT_THAT(findings_of(truth, tracks_with_a_turn(truth, Vec3::UnitY(), 0)),
              Not(HasSubstr("has moved")));
}

/// The surface as the pictures of the last projectors show it, from `first` on: so far along the
/// rays of the cameras.
std::vector<Track> tracks_of_a_moved_scene(const Rig& truth, std::size_t first, double shift) {
  BundleProblem problem;
  problem.devices = placed_devices(truth);
  std::vector<Track> tracks = tracks_of(truth, {.count = 900});
  for (Track& track : tracks) {
    if (track.views[0].device >= truth.cameras.size()) continue;
    const Vec3 point = *triangulate(problem, track, kLeastAngle);
    const Vec3 eye = device_at(truth, track.views[0].device).center();
    const Vec3 moved = point + shift * (point - eye).normalized();
    for (TrackView& view : track.views)
      if (view.device >= truth.cameras.size() + first)
        view.pixel += *device_at(truth, view.device).project(moved) -
                      *device_at(truth, view.device).project(point);
  }
  return tracks;
}

/// Each pair of a camera and a projector makes sense, and the adjustment drops what contradicts.
TEST(Verdict, AnObjectThatMovedWhileACaptureWasTakenIsNamed) {
  const Rig truth = ring(3, 3);
  const std::string says =
      "the object moved while --captures number 1 was taken: between the pictures of proj";
  EXPECT_THAT(findings_of(truth, tracks_of_a_moved_scene(truth, 2, 1)),
              AllOf(HasSubstr(says), HasSubstr("and those of proj2")));
  EXPECT_THAT(findings_of(truth, tracks_of_a_moved_scene(truth, 2, 0)),
              Not(HasSubstr("moved while")));
}

/// These draw cam2 to a wrong place, from where right pairs contradict.
TEST(Verdict, SwappedFoldersAreNamedThoughTheyMisplaceADevice) {
  const Rig truth = ring(4, 4);
  const auto tracks = with_exchanged(tracks_of(truth, {.count = 1000, .seed = 7}), {2, 5}, {2, 6});
  const std::string all = findings_of(truth, tracks);
  EXPECT_THAT(all, HasSubstr("the folders proj1/cam2 and proj2/cam2 are swapped"));
  EXPECT_THAT(all, Not(HasSubstr("has moved")));
}

TEST(Uncertainty, CoversTheErrorsOfTheResult) {
  const Rig truth = ring(3, 3);
  const auto result = calibrate(input_of(truth, tracks_of(truth, {.count = 600}), true), kQuick);
  const Uncertainty sigma = uncertainty(result.problem, result.adjustment);
  for (std::size_t d = 3; d < 6; ++d) {
    const double error = device_at(result.rig, d).K(0, 0) - device_at(truth, d).K(0, 0);
    EXPECT_GT(sigma.devices[d].inner[kFx], 0);
    EXPECT_LT(std::abs(error), 4 * sigma.devices[d].inner[kFx]);
  }
  EXPECT_GT(sigma.volume_median, 0);
  EXPECT_LT(sigma.volume_median, 0.2);  // mm: 0.05 px is 0.025 mm in this volume
}

TEST(Uncertainty, OfCentresHangsLittleOnWhereTheOriginIs) {
  const Rig truth = ring(3, 3);
  auto result = calibrate(input_of(truth, tracks_of(truth, {.count = 600}), true), kQuick);
  const Uncertainty here = uncertainty(result.problem, result.adjustment);
  move_solution(1, {Mat3::Identity(), Vec3(5000, -3000, 2000)}, result.problem);
  const Uncertainty there = uncertainty(result.problem, result.adjustment);
  // The turn of the whole rig that means nothing is chosen by turns and shifts as they are: 3.6
  // times as much. The deviation of t alone, taken for that of the centre: 8 times.
  for (std::size_t d = 0; d < 6; ++d)
    EXPECT_LT(there.devices[d].position.cwiseQuotient(here.devices[d].position).maxCoeff(), 4) << d;
}

/// Six and six devices that look inwards, as found without error.
CalibrationResult exact_ring(const std::vector<Track>& tracks, const Rig& truth) {
  CalibrationResult result;
  result.solved = true;
  result.rig = truth;
  for (std::size_t d = 0; d < device_count(truth); ++d) {
    result.problem.devices.push_back(bundle_device(device_at(truth, d)));
    result.problem.devices.back().present = true;
  }
  result.problem.tracks = tracks;
  triangulate_all(result.problem, kLeastAngle);
  return result;
}

TEST(LoopClosure, RingClosesUnlessADeviceStandsElsewhereForOneOfItsNeighbours) {
  const Rig truth = ring(6, 6);
  std::vector<Track> tracks = tracks_of(truth, {.count = 3000, .noise_px = 0.02});
  const LoopClosure loop = close_loop(exact_ring(tracks, truth));
  ASSERT_EQ(loop.devices.size(), 12U);
  EXPECT_EQ(loop.devices.front(), 0U);
  EXPECT_LT(loop.gap_px, 0.5);
  EXPECT_NEAR(loop.scale, 1, 2e-3);
  EXPECT_FALSE(judge_loop(exact_ring(tracks, truth), loop).has_value());
  // What proj0 and cam1 see of each other, seen by a camera turned by 1 / 300.
  for (Track& track : tracks)
    for (TrackView& view : track.views)
      if (view.device == 1 && view_in(track, 6) != nullptr) view.pixel.x() += 7.5;
  const CalibrationResult turned = exact_ring(tracks, truth);
  const LoopClosure open = close_loop(turned);
  ASSERT_FALSE(open.devices.empty());
  EXPECT_GT(open.gap_px, 3);
  ASSERT_TRUE(judge_loop(turned, open).has_value());
  EXPECT_THAT(judge_loop(turned, open)->what, HasSubstr("does not close"));
}

TEST(LoopClosure, AnArcHasNone) {
  const Rig truth = ring(2, 2);
  const auto loop = close_loop(exact_ring(tracks_of(truth, {.count = 500}), truth));
  EXPECT_TRUE(loop.devices.empty());
}

/// Before wide lenses fundamental matrices explain few correspondences: the rig does.
TEST(Judge, PairsThatTheRigExplainsAreRigidWhateverFundamentalMatricesSay) {
  const Rig truth = ring(2, 2);
  for (const double wrong : {0.0, 0.5}) {
    const CalibrationInput input =
        input_of(truth, tracks_of(truth, {.count = 900, .outliers = wrong}), true);
    CalibrationResult result = exact_ring(input.tracks, truth);
    result.placed.assign(4, 1);
    result.residuals.resize(4);
    result.given.assign(4, GivenUse::kNone);
    const std::size_t matches = matches_by_pair(input.tracks).at({0, 2}).size();
    result.pairs = {{.camera = 0, .projector = 2, .matches = matches, .inliers = matches / 2}};
    Uncertainty sigma;
    sigma.devices.resize(4);
    std::string all;
    for (const Finding& finding : judge(input, result, sigma, {}).findings)
      all += finding.what + "\n";
    const auto complaint = HasSubstr("of the correspondences of proj0/cam0 fit a rigid scene");
    if (wrong == 0)
      EXPECT_THAT(all, Not(complaint));
    else
      EXPECT_THAT(all, complaint);
  }
}

/// A ring as it is, every other correspondence of projector proj0 wrong.
class RingWithWrongCodes : public testing::Test {
 protected:
  static constexpr std::size_t kWrong = 3;
  RingWithWrongCodes() {
    const Rig truth = ring(3, 3);
    std::vector<Track> tracks = tracks_of(truth, {.count = 900});
    Random random(5);
    for (Track& track : tracks)
      for (std::size_t i = 1; i < track.views.size(); ++i)
        if ((track.views[0].device == kWrong || track.views[i].device == kWrong) &&
            random.below(2) == 0)
          track.views[i].pixel = Vec2(random.uniform(0, 300), random.uniform(0, 200));
    input_ = input_of(truth, tracks, true);
    result_ = exact_ring(input_.tracks, truth);
    result_.solved = true;
    result_.placed.assign(6, 1);
    result_.residuals.resize(6);
    result_.given.assign(6, GivenUse::kNone);
    for (const auto& [pair, matches] : matches_by_pair(input_.tracks))
      result_.pairs.push_back({.camera = pair.first,
                               .projector = pair.second,
                               .matches = matches.size(),
                               .inliers = matches.size() / (pair.second == kWrong ? 2 : 1)});
  }
  [[nodiscard]] Verdict verdict(std::vector<Finding> before = {}) const {
    Uncertainty sigma;
    sigma.devices.resize(6);
    return judge(input_, result_, sigma, std::move(before));
  }
  static std::string text(const Verdict& verdict) {
    std::string all;
    for (const Finding& finding : verdict.findings) all += finding.what + "\n";
    return all;
  }

  CalibrationInput input_;
  CalibrationResult result_;
};

TEST_F(RingWithWrongCodes, ADeviceThatFitsNoneIsNamedOnceAndMakesItUnusable) {
  const Verdict found = verdict();
  EXPECT_EQ(found.grade, Grade::kUnusable);
  EXPECT_THAT(found.findings[0].what, HasSubstr("the codes of proj0 make no sense"));
  EXPECT_THAT(text(found), AllOf(Not(HasSubstr("proj0/cam")), Not(HasSubstr("has moved"))));
}

TEST_F(RingWithWrongCodes, WhatExplainsThatADeviceHasNoPlaceSilencesIt) {
  result_.placed[kWrong] = 0;
  result_.problem.devices[kWrong].present = false;
  EXPECT_THAT(text(verdict()), HasSubstr("proj0 shares too few"));
  const Finding order{Grade::kUnusable, "wrong order", "", {kWrong}};
  EXPECT_EQ(verdict({order}).findings[0].what, "wrong order");
  EXPECT_THAT(text(verdict({order})), Not(HasSubstr("proj0 shares too few")));
  const Finding of_all{Grade::kUnusable, "wrong order", "", {0, 1, 2, 3, 4, 5}};
  EXPECT_EQ(text(verdict({of_all})), "wrong order\n");
}

TEST(CalibrationReport, SaysVerdictLoopAndPlaces) {
  const Rig truth = ring(2, 2);
  const CalibrationInput input = input_of(truth, tracks_of(truth, {.count = 400}), true);
  const auto result = calibrate(input, kQuick);
  const Uncertainty sigma = uncertainty(result.problem, result.adjustment);
  const Verdict verdict = judge(input, result, sigma, {});
  const LoopClosure loop = close_loop(result);
  const CalibrationReport report{input, result, sigma, verdict, {}, loop, {}};
  const auto json = calibration_json(report);
  EXPECT_EQ(json["devices"].size(), 4U);
  EXPECT_FALSE(json["loop"]["closed_ring"].get<bool>());
  EXPECT_EQ(json["verdict"], to_string(verdict.grade));
  // Places for the 3-D picture: a point is where a device saw it.
  EXPECT_GT(json["points"].size(), 100U);
  const RigidTransform& pose = device_at(result.rig, 1).device_from_world;
  const auto& device = json["devices"][1];
  for (int row = 0; row < 3; ++row) {
    const auto axis = device["R"][static_cast<std::size_t>(row)].get<std::vector<double>>();
    for (int k = 0; k < 3; ++k) EXPECT_EQ(axis[static_cast<std::size_t>(k)], pose.rotation(row, k));
    EXPECT_EQ(device["t"][static_cast<std::size_t>(row)].get<double>(), pose.translation(row));
  }
}

}  // namespace
}  // namespace pencilscan
