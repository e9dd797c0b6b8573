#include "pencilscan/points/surface_check.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "pencilscan/core/median.h"
#include "pencilscan/io/srgb.h"
#include "pencilscan/labeling/two_projector_scene.h"
#include "pencilscan/points/triangulate.h"

namespace pencilscan {
namespace {

/// The scene's surface as a measured mesh, and one camera's curves with true labels.
class SurfaceCheckTest : public testing::Test, protected TwoProjectorScene {
 protected:
  SurfaceCheckTest() : graph_(graph(0, 50, 0.1, 3)) {
    constexpr int kSide = 161;
    constexpr double kStep = 0.75;  // mm
    for (int row = 0; row < kSide; ++row) {
      for (int column = 0; column < kSide; ++column)
        mesh_.vertices.push_back(surface((column - kSide / 2) * kStep, (row - kSide / 2) * kStep));
    }
    for (int row = 0; row + 1 < kSide; ++row) {
      for (int column = 0; column + 1 < kSide; ++column) {
        const int v = row * kSide + column;
        mesh_.faces.push_back({v, v + 1, v + kSide});
        mesh_.faces.push_back({v + 1, v + kSide + 1, v + kSide});
      }
    }
    mesh_.sigma.assign(mesh_.vertices.size(), 0.02F);
    mesh_.confidence.assign(mesh_.vertices.size(), 1.F);
    labeling_.runs.resize(2);
    labeling_.undecided.resize(2);
    for (std::size_t k = 0; k < graph_.curves.size(); ++k) {
      const int line = true_lines[0][k];
      labeling_.runs[0].push_back({static_cast<int>(k), 0,
                                   static_cast<int>(graph_.curves[k].points.size()),
                                   CurveLabel{{graph_.curves[k].family, 0}, line, 1.0 * line, 1}});
    }
  }
  std::vector<MeasuredPoint> points() const { return triangulate(rig, {&graph_, 1}, labeling_); }
  std::size_t drop() { return drop_contradicted(rig, RayScene(mesh_), {&graph_, 1}, labeling_); }
  static double error(const MeasuredPoint& p) {
    return std::abs(static_cast<double>(p.x) - surface(p.y, p.z).x());
  }
  /// Moves a point of camera 0 away from it.
  void move_away(double mm, MeasuredPoint& p) const {
    const Vec3 x = position_of(p);
    set_position(x + mm * (x - rig.cameras[0].center()).normalized(), p);
  }
  /// Turns camera 1, which knows the surface as well, away from it.
  void look_elsewhere() {
    Mat3& turn = rig.cameras[1].device_from_world.rotation;
    turn = Eigen::AngleAxisd(2, Vec3::UnitY()) * turn;
  }
  /// Gives a curve its neighbour's line.
  void name_wrongly(std::size_t curve) {
    CurveLabel& label = labeling_.runs[0][curve].label;
    ++label.line;
    label.plane = label.line;
  }

  GridGraph graph_;
  TriangleMesh mesh_;
  Labeling labeling_;
};

TEST_F(SurfaceCheckTest, LabelsThatTheSurfaceContradictsGoAndTheOthersStay) {
  const std::size_t all = labelled_points(labeling_);
  EXPECT_EQ(drop(), 0U);
  EXPECT_EQ(labelled_points(labeling_), all);

  const std::size_t wrong = graph_.curves.size() / 3;
  name_wrongly(wrong);
  const std::size_t points_of_wrong = graph_.curves[wrong].points.size();
  EXPECT_EQ(drop(), points_of_wrong);
  EXPECT_EQ(labelled_points(labeling_), all - points_of_wrong);
  EXPECT_TRUE(
      std::none_of(labeling_.runs[0].begin(), labeling_.runs[0].end(),
                   [&](const LabeledRun& run) { return run.curve == static_cast<int>(wrong); }));
  EXPECT_EQ(undecided_points(labeling_.undecided[0], labeling_.runs[0])[2], points_of_wrong);
}

TEST_F(SurfaceCheckTest, APixelHasOnePointOfALineThoughOneLiesAtItsEdge) {
  Curve beside = graph_.curves.front();
  for (std::size_t i = 0; i < beside.points.size(); ++i) {
    float& row = graph_.curves.front().points[i].position.y();
    row = std::round(row);
    beside.points[i].position = {graph_.curves.front().points[i].position.x(),
                                 std::nextafter(row + 0.5F, 0.F)};
    beside.points[i].sigma_px *= 2;
  }
  LabeledRun run = labeling_.runs[0].front();
  labeling_.runs[0] = {run};
  const std::vector<MeasuredPoint> alone = points();
  run.curve = static_cast<int>(graph_.curves.size());
  graph_.curves.push_back(beside);
  labeling_.runs[0].push_back(run);
  const std::vector<MeasuredPoint> both = points();
  ASSERT_EQ(both.size(), alone.size());
  for (std::size_t i = 0; i < both.size(); ++i) EXPECT_EQ(both[i].v, alone[i].v);
}

TEST_F(SurfaceCheckTest, WhatWasNotMeasuredContradictsNothing) {
  name_wrongly(graph_.curves.size() / 3);
  mesh_.confidence.assign(mesh_.vertices.size(), 0.F);
  EXPECT_EQ(drop(), 0U);
  const SettledPoints settled = settle_on_surface(rig, RayScene(mesh_), points(), 0);
  EXPECT_EQ(settled.contradicted, 0U);
  EXPECT_TRUE(std::none_of(settled.evidence.begin(), settled.evidence.end(),
                           [](const PointEvidence& e) { return e.settled; }));
}

TEST_F(SurfaceCheckTest, ALineStaysWhereTheSurfaceSurelyFacesItsProjector) {
  const std::vector<MeasuredPoint> all = points();
  const MeasuredPoint& point = all[all.size() / 2];
  const Vec3 x = position_of(point);
  const Vec3 to_light = (rig.projectors[point.projector].center() - x).normalized();
  const Vec3 to_camera = (rig.cameras[0].center() - x).normalized();
  const Vec3 beside_light = (to_camera - to_camera.dot(to_light) * to_light).normalized();
  const auto is_kept_at = [&](double cosine) {
    const Vec3 normal = cosine * to_light + std::sqrt(1 - cosine * cosine) * beside_light;
    const Vec3 across = 10 * normal.unitOrthogonal();
    const Vec3 along = normal.cross(across);
    TriangleMesh flat;
    flat.vertices = {x - across - along, x + across - along, x + across + along,
                     x - across + along};
    flat.faces = {{0, 1, 2}, {0, 2, 3}};
    flat.sigma.assign(4, 0.02F);
    flat.confidence.assign(4, 1.F);
    return settle_on_surface(rig, RayScene(flat), {&point, 1}, 0).points.size() == 1;
  };
  EXPECT_TRUE(is_kept_at(0.5));
  EXPECT_TRUE(is_kept_at(0.15));
  EXPECT_FALSE(is_kept_at(0.05)) << "the mesh's slope errs by as much";
  EXPECT_FALSE(is_kept_at(-0.05));
}

TEST_F(SurfaceCheckTest, PointsOfLittleConfidenceStayOnMeasuredSurfaceOnly) {
  std::vector<MeasuredPoint> doubtful = points();
  for (MeasuredPoint& p : doubtful) p.confidence = 0.99F;
  const auto kept = [&] {
    return settle_on_surface(rig, RayScene(mesh_), doubtful, 0.995F).points.size();
  };
  EXPECT_GT(kept(), 0.9 * static_cast<double>(doubtful.size()));
  mesh_.confidence.assign(mesh_.vertices.size(), 0.F);
  EXPECT_EQ(kept(), 0U);
  for (MeasuredPoint& p : doubtful) p.confidence = 0.999F;
  EXPECT_EQ(kept(), doubtful.size());
}

TEST_F(SurfaceCheckTest, PointsSettleOnTheSurfaceAndTheirSigmaTellsOfTheWayThere) {
  name_wrongly(graph_.curves.size() / 3);
  const std::vector<MeasuredPoint> before = points();
  const SettledPoints settled = settle_on_surface(rig, RayScene(mesh_), before, 0);
  const auto is_far_off = [](const MeasuredPoint& p) { return error(p) > 1; };
  EXPECT_GT(std::count_if(before.begin(), before.end(), is_far_off), 100);
  EXPECT_EQ(std::count_if(settled.points.begin(), settled.points.end(), is_far_off), 0);
  EXPECT_EQ(settled.contradicted, before.size() - settled.points.size());
  ASSERT_EQ(settled.evidence.size(), settled.points.size());
  std::vector<double> errors;
  std::size_t moved_far = 0;
  for (std::size_t i = 0, j = 0; i < settled.points.size(); ++i, ++j) {
    while (before[j].u != settled.points[i].u || before[j].v != settled.points[i].v) ++j;
    if (!settled.evidence[i].settled) continue;
    errors.push_back(error(settled.points[i]));
    const double way =
        std::hypot(before[j].x - settled.points[i].x, before[j].y - settled.points[i].y,
                   before[j].z - settled.points[i].z);
    EXPECT_GE(settled.points[i].sigma, 0.16 * way);
    EXPECT_GE(settled.points[i].sigma, 0.86F * 0.02F);
    moved_far += way > 0.05 ? 1 : 0;
  }
  EXPECT_GT(errors.size(), before.size() / 2);
  EXPECT_GT(moved_far, 20U) << "the noise of the curves ought to be seen";
  EXPECT_LT(upper_median(std::move(errors)), 0.01);
}

TEST_F(SurfaceCheckTest, PointsTooFarOffTheSurfaceAreLeftOutThoughTheirLineFits) {
  // A tenth of the points is off by 1 mm along the ray: less than half a line, 20 deviations.
  std::vector<MeasuredPoint> moved = points();
  look_elsewhere();
  std::size_t off = 0;
  for (std::size_t i = 0; i < moved.size(); ++i) {
    moved[i].sigma = 0.04F;
    if (i % 10 != 0) continue;
    move_away(1, moved[i]);
    ++off;
  }
  const SettledPoints settled = settle_on_surface(rig, RayScene(mesh_), moved, 0);
  EXPECT_GE(settled.contradicted, off);
  EXPECT_LT(settled.contradicted, off + moved.size() / 20);
  EXPECT_EQ(std::count_if(settled.points.begin(), settled.points.end(),
                          [](const MeasuredPoint& p) { return error(p) > 0.5; }),
            0);
}

TEST_F(SurfaceCheckTest, OddPointsAreLeftOutWhereAnotherCameraKnowsTheSurfaceBetter) {
  // A tenth of the points is off by five deviations: too far to settle, too near to be wrong.
  std::vector<MeasuredPoint> moved = points();
  for (std::size_t i = 0; i < moved.size(); ++i) {
    moved[i].sigma = 0.15F;
    if (i % 10 == 0) move_away(5 * std::hypot(0.15, 0.02), moved[i]);
  }
  const auto tenths_kept_odd = [&] {
    const SettledPoints settled = settle_on_surface(rig, RayScene(mesh_), moved, 0);
    const auto odd = std::count_if(settled.evidence.begin(), settled.evidence.end(),
                                   [](const PointEvidence& e) { return !e.settled; });
    return 10 * static_cast<double>(odd) / static_cast<double>(moved.size());
  };
  const double kept = tenths_kept_odd();
  look_elsewhere();
  EXPECT_GT(tenths_kept_odd(), 0.2) << "the others lie too far off their line or the surface";
  EXPECT_LT(kept, 0.02);
}

TEST_F(SurfaceCheckTest, PointsHaveTheNormalAndTheColourOfTheSurface) {
  // Lighter from one side of the surface to the other.
  std::vector<std::array<float, 3>> colors;
  for (const Vec3& x : mesh_.vertices)
    colors.push_back({static_cast<float>(0.5 + x.y() / 200), 0.25F, 0.5F});
  const SettledPoints settled = settle_on_surface(rig, RayScene(mesh_), points(), 0, colors);
  std::size_t known = 0;
  for (std::size_t i = 0; i < settled.points.size(); ++i) {
    const MeasuredPoint& p = settled.points[i];
    const Vec3 normal(p.nx, p.ny, p.nz);
    EXPECT_EQ(normal.isZero(), !settled.evidence[i].settled);
    if (!settled.evidence[i].settled) continue;
    ++known;
    constexpr double kStep = 0.5;  // mm
    const Vec3 along_y = surface(p.y + kStep, p.z) - surface(p.y - kStep, p.z);
    const Vec3 along_z = surface(p.y, p.z + kStep) - surface(p.y, p.z - kStep);
    constexpr double kSameDirection = 0.995;  // 6 degrees: the mesh is coarse
    EXPECT_NEAR(normal.norm(), 1, 1e-6);
    EXPECT_GT(normal.dot(along_y.cross(along_z).normalized()), kSameDirection);
    EXPECT_NEAR(from_srgb(p.red / 255.0), 0.5 + p.y / 200.0, 0.01);
    EXPECT_EQ(p.green, to_srgb_byte(0.25));
  }
  EXPECT_GT(known, settled.points.size() / 2);
  const SettledPoints colorless = settle_on_surface(rig, RayScene(mesh_), points(), 0);
  EXPECT_EQ(colorless.points.front().green, 0);
}

}  // namespace
}  // namespace pencilscan
