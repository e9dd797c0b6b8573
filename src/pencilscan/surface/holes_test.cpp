#include "pencilscan/surface/holes.h"

#include <gtest/gtest.h>

#include "pencilscan/surface/sample_ball.h"
#include "pencilscan/surface/surface.h"

namespace pencilscan {
namespace {

using sample::ball_rig;
using sample::kDistance;
using sample::kRadius;

TEST(Holes, ReasonsFollowFromWhoSeesAndWhoLights) {
  Rig rig = ball_rig();
  // One camera and one projector on the +x side, none that sees or lights -x.
  rig.cameras.resize(1);
  rig.projectors.resize(1);
  rig.projectors[0].device_from_world = look_at(kDistance * Vec3(0.7, 0.7, 0), Vec3::Zero());
  TriangleMesh ball = make_sphere(kRadius, 48);
  ball.confidence.assign(ball.vertices.size(), 0.F);
  DepthMap map;
  map.columns = map.rows = 160;
  map.nodes.resize(160 * 160);
  map.nodes[map.index(80, 80)].reason = HoleReason::kContradicted;
  std::vector<DepthMap> maps = {map};
  const HoleReport report = explain_holes(rig, RayScene(ball), maps);
  double total = 0;
  for (const double area : report.area_mm2) total += area;
  EXPECT_NEAR(total, surface_area(ball), 1e-6 * total);
  for (std::size_t v = 0; v < ball.vertices.size(); ++v) {
    const Vec3 n = ball.vertices[v].normalized();
    const double to_camera = n.dot((rig.cameras[0].center() - ball.vertices[v]).normalized());
    const double to_light = n.dot((rig.projectors[0].center() - ball.vertices[v]).normalized());
    if (to_camera < -0.05) {
      EXPECT_EQ(report.vertices[v], HoleReason::kNotSeen);
    } else if (to_camera > 0.3 && to_light < 0.1) {
      EXPECT_EQ(report.vertices[v], HoleReason::kNoProjector);
    } else if (to_camera > 0.5 && to_light > 0.5) {
      EXPECT_TRUE(report.vertices[v] == HoleReason::kOneProjector ||
                  report.vertices[v] == HoleReason::kContradicted);
    }
  }
  // What the depth stage found stays; rays past the ball are background.
  EXPECT_EQ(maps[0].nodes[map.index(80, 80)].reason, HoleReason::kContradicted);
  EXPECT_EQ(maps[0].nodes[0].reason, HoleReason::kBackground);
}

TEST(Holes, TheMeasuredShareIsThatOfTheAreas) {
  SurfaceResult result;
  result.mesh = make_sphere(kRadius, 48);
  for (const Vec3& x : result.mesh.vertices)  // the lower half, and an island at the top
    result.mesh.confidence.push_back(x.z() < 0 || x.z() > 0.99 * kRadius ? 1.F : 0.F);
  result.report.spacing_mm = 0.1 * kRadius;
  finish_surface({}, result);
  std::vector<DepthMap> maps;
  const HoleReport report = explain_holes(ball_rig(), RayScene(result.mesh), maps);
  const double measured = report.area_mm2[static_cast<std::size_t>(HoleReason::kMeasured)];
  const double whole = surface_area(result.mesh);
  EXPECT_LT(surface_area(result.measured), 0.999 * measured);  // which the island is not in
  EXPECT_NEAR(result.report.measured_share, measured / whole, 1e-9);
}

}  // namespace
}  // namespace pencilscan
