#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "pencilscan/geometry/least_squares.h"
#include "pencilscan/labeling/two_projector_scene.h"
#include "pencilscan/refinement/determinacy.h"
#include "pencilscan/refinement/refine_rig.h"
#include "pencilscan/refinement/ring_scene.h"
#include "pencilscan/refinement/track_residual.h"

namespace pencilscan {
namespace {

using testing::HasSubstr;

std::vector<PoseCorrection> of_track(const TrackResidual& residual, const RigCorrection& all) {
  std::vector<PoseCorrection> poses;
  for (const std::size_t d : residual.devices()) poses.push_back(all[d]);
  return poses;
}

double& parameter(PoseCorrection& c, Eigen::Index k) {
  return k < 3 ? c.rotation_px[k] : c.translation_mm[k - 3];
}

TEST(ProjectionJacobian, IsTheDerivativeOfTheProjection) {
  const RingScene scene(true);
  const Vec3 x(120, -70, 1050);
  for (const Device* device : {static_cast<const Device*>(&scene.rig.cameras[1]),
                               static_cast<const Device*>(&scene.rig.projectors[2])}) {
    const auto jacobian = projection_jacobian(*device, x);
    constexpr double kStep = 1e-3;
    for (Eigen::Index k = 0; k < 3; ++k) {
      const Vec3 step = kStep * Vec3::Unit(k);
      const Vec2 slope =
          (device->pixel_from_device(x + step) - device->pixel_from_device(x - step)) / (2 * kStep);
      EXPECT_LT((jacobian.col(k) - slope).norm(), 1e-6);  // of about 2 px per mm
    }
  }
}

TEST(PoseJacobian, IsTheDerivativeOfTheCorrectedPose) {
  const RingScene scene;
  const Device& device = scene.rig.cameras[2];
  const Vec3 point(10, 20, 30);
  const PoseCorrection at{{3, -2, 4}, {0.5, -1, 2}};
  const auto jacobian = pose_jacobian(device, at, corrected_pose(device, at) * point);
  constexpr double kStep = 1e-3;
  for (Eigen::Index k = 0; k < 6; ++k) {
    PoseCorrection ahead = at;
    PoseCorrection behind = at;
    parameter(ahead, k) += kStep;
    parameter(behind, k) -= kStep;
    const Vec3 slope =
        (corrected_pose(device, ahead) * point - corrected_pose(device, behind) * point) /
        (2 * kStep);
    EXPECT_LT((jacobian.col(k) - slope).norm(), 1e-6);
  }
}

TEST(CorrectionTo, IsTheInverseOfTheCorrectedPose) {
  const Device device = sample::small_rig(480, 360, 110).projectors[0];
  for (const PoseCorrection& by :
       {PoseCorrection{}, PoseCorrection{Vec3(120, -80, 300), Vec3(4, -30, 2)}}) {
    const PoseCorrection found = correction_to(corrected_pose(device, by), device);
    EXPECT_LT((found.rotation_px - by.rotation_px).norm(), 1e-9);
    EXPECT_LT((found.translation_mm - by.translation_mm).norm(), 1e-9);
  }
}

TEST(TrackResidual, GradientIsThatOfTheResidualWithItsPointSolvedFor) {
  const RingScene scene(true);
  const std::vector<CrossingTrack> tracks = scene.tracks(20, 0.3, 5);
  ASSERT_GT(tracks.size(), 5U);
  const RigCorrection errors = scene.errors(1, 0.3, 6);
  for (const CrossingTrack& track : tracks) {
    const TrackResidual residual(scene.rig, track, 0.05);
    const auto poses = of_track(residual, errors);
    const auto value = residual.evaluate(poses, true);
    ASSERT_TRUE(value);
    EXPECT_EQ(value->residual.size(), 2 * 4 + 2);
    const Eigen::VectorXd gradient = value->jacobian.transpose() * value->residual;
    const auto cost = [&](const std::vector<PoseCorrection>& at) {
      return 0.5 * residual.evaluate(at, false)->residual.squaredNorm();
    };
    for (Eigen::Index k = 0; k < gradient.size(); ++k) {
      constexpr double kStep = 1e-4;
      auto ahead = poses;
      auto behind = poses;
      parameter(ahead[static_cast<std::size_t>(k / 6)], k % 6) += kStep;
      parameter(behind[static_cast<std::size_t>(k / 6)], k % 6) -= kStep;
      const double slope = (cost(ahead) - cost(behind)) / (2 * kStep);
      EXPECT_NEAR(gradient[k], slope, 1e-4 * gradient.norm());
    }
  }
}

/// Number of combined device motions that no track can see, and how much one can see of the
/// motions of the whole rig.
std::pair<int, double> unseen_directions(const RingScene& scene) {
  const std::vector<CrossingTrack> tracks = scene.tracks(8, 0, 7);
  const RigCorrection none(device_count(scene.rig));
  const auto size = 6 * static_cast<Eigen::Index>(none.size());
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(size, size);
  for (const CrossingTrack& track : tracks) {
    const TrackResidual residual(scene.rig, track, 0.01);
    const auto value = residual.evaluate(of_track(residual, none), true);
    Eigen::MatrixXd row = Eigen::MatrixXd::Zero(value->jacobian.rows(), size);
    for (std::size_t k = 0; k < residual.devices().size(); ++k) {
      row.middleCols<6>(6 * static_cast<Eigen::Index>(residual.devices()[k])) =
          value->jacobian.middleCols<6>(6 * static_cast<Eigen::Index>(k));
    }
    sum += row.transpose() * row;
  }
  const Eigen::VectorXd singular = symmetric_eigen(sum).values.reverse();
  const int unseen = static_cast<int>((singular.array() < 1e-10 * singular[0]).count());
  const Eigen::MatrixXd gauge = gauge_directions(scene.rig, Vec3(5, -3, 8));
  double seen = 0;
  for (Eigen::Index k = 0; k < gauge.cols(); ++k) {
    const Eigen::VectorXd direction = gauge.col(k).normalized();
    seen = std::max(seen, direction.dot(sum * direction) / singular[0]);
  }
  return {unseen, seen};
}

TEST(Gauge, UnseenAreSevenMotionsOfTheRigAndEachProjectorAlongItsLines) {
  const RingScene scene;
  const auto [unseen, seen] = unseen_directions(scene);
  // Without distortion, the light sheets of straight lines stay when the projector moves along
  // the line that they all meet in.
  EXPECT_EQ(unseen, 7 + 4);
  EXPECT_LT(seen, 1e-12);
}

/// Root mean square distance of the points from the truth after the best similarity: `scene` knows
/// the truth of the tracks, `rig` places the points.
double shape_error_mm(const RingScene& scene, const Rig& rig,
                      std::span<const CrossingTrack> tracks) {
  const RigCorrection none(device_count(rig));
  Eigen::Matrix3Xd measured(3, static_cast<Eigen::Index>(tracks.size()));
  Eigen::Matrix3Xd truth(3, measured.cols());
  for (Eigen::Index t = 0; t < measured.cols(); ++t) {
    const auto i = static_cast<std::size_t>(t);
    const TrackResidual residual(rig, tracks[i], 0.02);
    measured.col(t) = residual.evaluate(of_track(residual, none), false)->point;
    truth.col(t) = scene.truth[i];
  }
  const Eigen::Matrix4d motion = fit_similarity(measured, truth, true);
  const Eigen::Matrix3Xd moved =
      (motion.topLeftCorner<3, 3>() * measured).colwise() + motion.topRightCorner<3, 1>();
  return std::sqrt((moved - truth).squaredNorm() / static_cast<double>(measured.cols()));
}

constexpr double kNoisePx = 0.05;
/// 0.05 px at 1.1 m and f = 2300 px are 0.024 mm; points of four views are better than that.
constexpr double kNoiseMm = 0.024;

TEST(RefineRig, RecoversPerturbedPosesInSpiteOfWrongLabels) {
  for (const bool has_distortion : {false, true}) {
    const RingScene scene(has_distortion);
    std::vector<CrossingTrack> tracks = scene.tracks(4, kNoisePx, 8);
    const std::vector<CrossingTrack> right = tracks;
    // One line in eight is the neighbour's.
    for (std::size_t t = 0; t < tracks.size(); t += 8)
      tracks[t].lines[t / 8 % 2].coordinate_px += 12;
    const Rig given = corrected_rig(scene.rig, scene.errors(1, 0.3, 9));
    EXPECT_GT(shape_error_mm(scene, given, right), 5 * kNoiseMm);
    const RefineRigResult result = refine_rig(given, tracks);
    ASSERT_TRUE(result.report.refined) << result.report.reason;
    EXPECT_LT(shape_error_mm(scene, corrected_rig(given, result.correction), right), kNoiseMm);
    EXPECT_LT(result.report.after.median_px, 0.25 * result.report.before.median_px);
    EXPECT_LT(result.report.remaining_error_px, 0.25 * result.report.expected_error_px);
    for (const DeviceRefinement& device : result.report.devices) {
      EXPECT_TRUE(device.refined);
      EXPECT_LT(device.rotation_px, 3);
      EXPECT_LT(device.translation_mm, 1.5);
    }
  }
}

TEST(RefineRig, LeavesATrueRigWhereItIs) {
  const RingScene scene;
  const auto tracks = scene.tracks(4, kNoisePx, 10);
  const RefineRigResult result = refine_rig(scene.rig, tracks);
  ASSERT_TRUE(result.report.refined) << result.report.reason;
  for (const DeviceRefinement& device : result.report.devices) {
    // Not by what noise says where a turn and a shift make up for each other.
    EXPECT_LT(device.rotation_px, 0.02) << device.name;
    EXPECT_LT(device.translation_mm, 0.01) << device.name;
  }
  EXPECT_LT(shape_error_mm(scene, corrected_rig(scene.rig, result.correction), tracks), kNoiseMm);
}

TEST(RefineRig, MovesNoDeviceThatHasTooFewCrossings) {
  const RingScene scene;
  std::vector<CrossingTrack> tracks = scene.tracks(4, kNoisePx, 11);
  // The last camera saw next to nothing.
  for (std::size_t t = 5; t < tracks.size(); ++t) tracks[t].sightings.pop_back();
  const Rig given = corrected_rig(scene.rig, scene.errors(1, 0.3, 12));
  const RefineRigResult result = refine_rig(given, tracks);
  ASSERT_TRUE(result.report.refined) << result.report.reason;
  EXPECT_FALSE(result.report.devices[3].refined);
  EXPECT_EQ(result.correction[3].rotation_px, Vec3::Zero());
  EXPECT_EQ(result.correction[3].translation_mm, Vec3::Zero());
  EXPECT_TRUE(result.report.devices[2].refined);
}

TEST(RefineRig, RefusesWithoutCrossings) {
  const RingScene scene;
  const RefineRigResult result = refine_rig(scene.rig, {});
  EXPECT_FALSE(result.report.refined);
  EXPECT_THAT(result.report.reason, HasSubstr("crossings"));
}

TEST(RefineRig, RefusesWhenCrossingsAreFarTooFew) {
  const RingScene scene;
  std::vector<CrossingTrack> tracks = scene.tracks(16, kNoisePx, 13);
  for (CrossingTrack& track : tracks) track.sightings.resize(1);
  RefineRigOptions options;
  options.min_tracks = 1;
  const RefineRigResult result = refine_rig(scene.rig, tracks, {}, options);
  EXPECT_FALSE(result.report.refined);
  EXPECT_THAT(result.report.reason, HasSubstr("equations"));
  for (const PoseCorrection& c : result.correction) EXPECT_EQ(c.rotation_px, Vec3::Zero());
}

TEST(CrossingTracks, JoinTheViewsOfOneSurfacePoint) {
  const TwoProjectorScene scene;
  const std::vector<GridGraph> graphs = {scene.graph(0, 40, 0, 1), scene.graph(1, 40, 0, 2)};
  Labeling labeling;
  labeling.runs.resize(2);
  std::size_t crossings = 0;
  for (std::size_t c = 0; c < 2; ++c) {
    for (std::size_t k = 0; k < graphs[c].curves.size(); ++k) {
      const auto points = static_cast<int>(graphs[c].curves[k].points.size());
      const CurveLabel label{*graphs[c].identities[k].pattern, scene.true_lines[c][k], 0, 1};
      labeling.runs[c].push_back({static_cast<int>(k), 0, points / 2, label});
      labeling.runs[c].push_back({static_cast<int>(k), points / 2, points, label});
    }
    crossings += graphs[c].crossings.size();
  }
  const auto tracks = crossing_tracks(scene.rig, graphs, labeling);
  std::size_t sightings = 0;
  std::size_t joined = 0;
  for (const CrossingTrack& track : tracks) {
    sightings += track.sightings.size();
    joined += track.sightings.size() == 2 ? 1 : 0;
    const Vec3 on_surface = TwoProjectorScene::surface(track.point.y(), track.point.z());
    EXPECT_NEAR(track.point.x(), on_surface.x(), 0.05);
  }
  EXPECT_EQ(sightings, crossings);
  EXPECT_GT(joined, tracks.size() * 9 / 10);
  EXPECT_LT(crossing_disagreement(scene.rig, tracks).median_px, 0.02);
}

TEST(CrossingTracks, LeaveOutCurvesThatMayHoldTwoLines) {
  TwoProjectorScene scene;
  std::vector<GridGraph> graphs = {scene.graph(0, 40, 0, 1)};
  Labeling labeling;
  labeling.runs.resize(2);
  for (std::size_t k = 0; k < graphs[0].curves.size(); ++k) {
    std::vector<CurvePoint>& points = graphs[0].curves[k].points;
    const CurveLabel label{*graphs[0].identities[k].pattern, scene.true_lines[0][k], 0, 1};
    labeling.runs[0].push_back({static_cast<int>(k), 0, static_cast<int>(points.size()), label});
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector2f way =
          points[std::min(i + 1, points.size() - 1)].position - points[i < 1 ? 0 : i - 1].position;
      points[i].normal = Eigen::Vector2f(way.y(), -way.x()).normalized();
    }
  }
  const std::size_t all = crossing_tracks(scene.rig, graphs, labeling).size();
  ASSERT_GT(all, 30U);
  // A projector of the same colours whose lines lie beside those of the first one.
  scene.rig.projectors.push_back(scene.rig.projectors[0]);
  LinePattern& beside = scene.rig.projectors[2].patterns.front();
  const double offset = beside.offset_px;
  beside.offset_px = offset + 0.1 * beside.pitch_px;
  EXPECT_EQ(crossing_tracks(scene.rig, graphs, labeling).size(), 0U);
  beside.offset_px = offset + 0.5 * beside.pitch_px;
  EXPECT_EQ(crossing_tracks(scene.rig, graphs, labeling).size(), all) << "apart in the picture";
  beside.offset_px = offset;
  beside.colors = scene.rig.projectors[1].patterns.front().colors;
  EXPECT_EQ(crossing_tracks(scene.rig, graphs, labeling).size(), all) << "another family's light";
}

}  // namespace
}  // namespace pencilscan
