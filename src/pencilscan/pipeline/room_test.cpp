#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <string>

#include "pencilscan/pipeline/frame.h"
#include "pencilscan/pipeline/sample_frame.h"
#include "pencilscan/simulation/simulated_object.h"

namespace pencilscan {
namespace {

constexpr double kBallBeforeWall = 60;  // mm
constexpr double kWallBehind = 450;  // mm, of the wall behind the ball's centre: outside the volume

Rig rig_before_wall() {
  RingOptions ring = sample::small_ring();
  ring.cameras = ring.projectors = 4;
  ring.arc_rad = 2.6;
  return make_ring(ring);
}

/// A wall square to the way in which the devices look, on the whole; before it a ball, or nothing.
TriangleMesh wall_behind(const Rig& rig, TriangleMesh mesh) {
  Vec3 devices = Vec3::Zero();
  for (const Camera& camera : rig.cameras) devices += camera.center();
  const Vec3 back = -Vec3(devices.x(), devices.y(), 0).normalized();
  const Vec3 aside = back.cross(Vec3::UnitZ());
  constexpr double kHalf = 1300;
  sample::add_square(kWallBehind * back, kHalf * aside, kHalf * Vec3::UnitZ(), mesh);
  return mesh;
}

Frame photograph_of(const Rig& rig, const TriangleMesh& mesh) {
  PhotographyOptions photo;
  photo.noise = "medium";
  return sample::photographed_frame(rig, SimulatedObject(mesh), photo);
}

bool is_in_air(const Vec3& x) {
  constexpr double kNear = 2;  // mm
  return std::abs(x.norm() - kBallBeforeWall) > kNear;
}

TEST(Room, AWallBehindTheObjectMakesNoSurfaceInTheAir) {
  const Rig rig = rig_before_wall();
  const FrameResult result = reconstruct_frame(
      rig, photograph_of(rig, wall_behind(rig, make_sphere(kBallBeforeWall, 96))));
  std::size_t in_air = 0;
  for (const MeasuredPoint& p : result.points.points) in_air += is_in_air(position_of(p)) ? 1 : 0;
  const std::size_t points = result.points.points.size();
  EXPECT_GT(points, 5000U);
  EXPECT_LT(in_air, points / 50);  // lines sought to two radii only: 43 %
  std::size_t vertices_in_air = 0;
  const auto& vertices = result.shape.surface.measured.vertices;
  for (const Vec3& x : vertices) vertices_in_air += is_in_air(x) ? 1 : 0;
  EXPECT_LT(vertices_in_air, vertices.size() / 20);  // the same: 64 %
}

TEST(Room, AWallAloneIsNoObject) {
  const Rig rig = rig_before_wall();
  try {
    const FrameResult result = reconstruct_frame(rig, photograph_of(rig, wall_behind(rig, {})));
    ADD_FAILURE() << result.points.points.size() << " points";
  } catch (const NothingFound& nothing) {
    EXPECT_NE(std::string(nothing.what()).find("nothing of the object was seen"), std::string::npos)
        << nothing.what();
  }
}

}  // namespace
}  // namespace pencilscan
