#include <gtest/gtest.h>

#include "pencilscan/surface/node_surface.h"
#include "pencilscan/surface/sample_ball.h"
#include "pencilscan/surface/untangle.h"

namespace pencilscan {
namespace {

using sample::ball_maps;
using sample::ball_points;
using sample::ball_rig;
using sample::expect_watertight;
using sample::hit_ball;
using sample::kMm;
using sample::kRadius;
using sample::share_beyond;
using sample::worst_deviation;

/// Closed and followed, without guided depth in between.
SurfaceResult surface_of(const Rig& rig, std::span<const MeasuredPoint> points,
                         std::span<const DepthMap> maps, const FusionOptions& options = {}) {
  SurfaceResult result = close_depth(rig, maps, options);
  follow_depth(rig, maps, options, result);
  note_points_used(rig, points, maps, result);
  finish_surface(options, result);
  return result;
}

TEST(FuseDepth, BallIsClosedAndAccurate) {
  const Rig rig = ball_rig();
  const std::vector<MeasuredPoint> points = ball_points(rig);
  FusionOptions options;
  options.cell_spacings = 2;  // the ball needs no finer cells
  const SurfaceResult result = surface_of(rig, points, ball_maps(rig), options);
  expect_watertight(result);
  EXPECT_LT(worst_deviation(result.mesh), 0.3 * kMm);  // three sigma of the noise
  EXPECT_LT(share_beyond(result.mesh, 0.1 * kMm), 0.1);
  EXPECT_GT(result.report.measured_share, 0.97);
  EXPECT_TRUE(self_intersections(result.mesh).empty());
  EXPECT_GT(result.report.points_used, points.size() * 9 / 10);
}

TEST(FuseDepth, FacesLieAsMuchOutsideAsInside) {
  const Rig rig = ball_rig();
  FusionOptions options;
  options.cell_spacings = 4;  // coarse: faces miss much
  options.subdivisions = 0;
  const TriangleMesh mesh = surface_of(rig, {}, ball_maps(rig, 0), options).mesh;
  double inside = 0;
  double least = kRadius;
  double area = 0;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const auto corner = [&](std::size_t k) {
      return mesh.vertices[static_cast<std::size_t>(mesh.faces[f][k])];
    };
    const double of_face = (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
    area += of_face;
    for (std::size_t k = 0; k < 3; ++k) {
      const double r = 0.5 * (corner(k) + corner((k + 1) % 3)).norm();
      inside += of_face / 3 * (kRadius - r);
      least = std::min(least, r);
    }
  }
  // Vertices on the ball leave half of the largest gap inside; a few of these have no depth.
  EXPECT_GT(kRadius - least, 0.05 * kMm);
  EXPECT_LT(std::abs(inside / area), 0.3 * (kRadius - least));
}

TEST(FollowNodes, VerticesReachACurvedSurface) {
  const Rig rig = ball_rig();
  TriangleMesh mesh = make_sphere(kRadius + 0.5 * kMm, 24);
  follow_nodes(rig, ball_maps(rig, 0), {}, mesh);
  // What is left is the third order of a ball over two nodes; a mean of positions would leave 0.04
  // mm.
  for (const Vec3& v : mesh.vertices) EXPECT_NEAR(v.norm(), kRadius, 0.02 * kMm);
}

TEST(FollowNodes, NodesCarriedOnTowardsAnOutlineTurnAwayAsABallDoes) {
  const Rig rig = ball_rig();
  const std::vector<DepthMap> maps{ball_maps(rig, 0)[0]};  // nodes to 72 degrees
  TriangleMesh mesh = make_sphere(kRadius, 96);
  const TriangleMesh ball = mesh;
  const std::vector<char> moved = follow_nodes(rig, maps, {}, mesh);
  int beyond = 0;
  double worst = 0;
  for (std::size_t v = 0; v < ball.vertices.size(); ++v) {
    const Vec3 n = ball.vertices[v].normalized();
    if (!moved[v] || n.dot((rig.cameras[0].center() - ball.vertices[v]).normalized()) > 0.3)
      continue;
    ++beyond;
    worst = std::max(worst, std::abs(mesh.vertices[v].norm() - kRadius));
  }
  EXPECT_GT(beyond, 20);
  // Carried on as they are, quadrics of inverse depth err by 0.27 mm.
  EXPECT_LT(worst, 0.05 * kMm);
}

TEST(FollowNodes, SlippedNodesDoNotPull) {
  const Rig rig = ball_rig();
  std::vector<DepthMap> maps = ball_maps(rig, 0);
  constexpr auto kSlip = static_cast<float>(0.9 * kMm);
  Random random(7);
  for (DepthMap& map : maps) {
    for (DepthNode& node : map.nodes) {
      if (node.measured() && random.uniform() < 0.1) node.w = 1 / (1 / node.w - kSlip);
    }
  }
  TriangleMesh mesh = make_sphere(kRadius + 0.2 * kMm, 24);
  follow_nodes(rig, maps, {}, mesh);
  double sum = 0;
  for (const Vec3& v : mesh.vertices) sum += std::abs(v.norm() - kRadius);
  // A plain mean would be off by a tenth of the slip.
  EXPECT_LT(sum / static_cast<double>(mesh.vertices.size()), 0.03 * kMm);
}

TEST(FollowNodes, NoStepWhereDepthEnds) {
  const Rig rig = ball_rig();
  std::vector<DepthMap> maps = ball_maps(rig, 0);
  for (DepthMap& map : maps) {
    const Camera& camera = rig.cameras[static_cast<std::size_t>(map.camera)];
    for (std::size_t i = 0; i < map.nodes.size(); ++i) {
      const auto x = hit_ball(camera.ray(map.pixel(i)));
      if (x && x->x() < 0) map.nodes[i] = DepthNode{};
    }
  }
  constexpr double kOff = 0.4 * kMm;
  TriangleMesh mesh = make_sphere(kRadius + kOff, 48);
  follow_nodes(rig, maps, {}, mesh);
  for (const auto& face : mesh.faces) {
    const double a = mesh.vertices[static_cast<std::size_t>(face[0])].norm();
    const double b = mesh.vertices[static_cast<std::size_t>(face[1])].norm();
    EXPECT_LT(std::abs(a - b), 0.5 * kOff);
  }
  // It did follow where depth is, and stayed where none is near.
  const auto [nearest, farthest] =
      std::minmax_element(mesh.vertices.begin(), mesh.vertices.end(),
                          [](const Vec3& a, const Vec3& b) { return a.norm() < b.norm(); });
  EXPECT_NEAR(nearest->norm(), kRadius, 0.1 * kOff);
  EXPECT_GT(farthest->norm(), kRadius + 0.5 * kOff);
}

TEST(FuseDepth, TooFewDepthsIsAStatus) {
  const Rig rig = ball_rig();
  std::vector<DepthMap> maps = ball_maps(rig);
  for (DepthMap& map : maps) map.nodes.assign(map.nodes.size(), DepthNode{});
  const SurfaceResult result = surface_of(rig, ball_points(rig), maps);
  EXPECT_EQ(result.report.status, SurfaceStatus::kTooFewPoints);
}

}  // namespace
}  // namespace pencilscan
