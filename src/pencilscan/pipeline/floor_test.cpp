#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "pencilscan/pipeline/frame.h"
#include "pencilscan/pipeline/sample_frame.h"
#include "pencilscan/simulation/simulated_object.h"

namespace pencilscan {
namespace {

// A ball that touches a lit floor, before three cameras and three projectors. Lines of the ball go
// on over the floor one or more lines off.
constexpr double kBallRadius = 60;
const Vec3 kBallCenter(0, 0, -10);
constexpr double kFloorHeight = -70;  // mm, height

Rig rig_before_floor() {
  RingOptions ring = sample::small_ring();
  ring.cameras = ring.projectors = 3;
  ring.arc_rad = 2.4;
  return make_ring(ring);
}

Frame frame_of(const Rig& rig) {
  TriangleMesh mesh = make_sphere(kBallRadius, 96, kBallCenter);
  constexpr double kHalf = 400;
  sample::add_square(kFloorHeight * Vec3::UnitZ(), kHalf * Vec3::UnitX(), kHalf * Vec3::UnitY(),
                     mesh);
  PhotographyOptions photo;
  photo.noise = "medium";
  return sample::photographed_frame(rig, SimulatedObject(mesh), photo);
}

/// Where points or vertices lie.
struct Places {
  std::size_t on_ball = 0, on_floor = 0, in_air = 0;

  void add(const Vec3& x) {
    constexpr double kNear = 1.5;  // mm
    if (std::abs((x - kBallCenter).norm() - kBallRadius) < kNear) {
      ++on_ball;
    } else if (std::abs(x.z() - kFloorHeight) < kNear) {
      ++on_floor;
    } else {
      ++in_air;
    }
  }
};

TEST(StatedFloor, LeavesTheObjectAloneWithoutFlapsBesideIt) {
  Rig rig = rig_before_floor();
  const Frame frame = frame_of(rig);
  std::array<Places, 2> points;
  std::array<Places, 2> surface;
  std::array<double, 2> lowest{};
  for (const std::size_t stated : {0, 1}) {
    if (stated == 1) rig.floor = Floor{{0, 0, kFloorHeight}, Vec3::UnitZ()};
    const FrameResult result = reconstruct_frame(rig, frame);
    for (const MeasuredPoint& p : result.points.points) points[stated].add(position_of(p));
    EXPECT_EQ(result.points.floor.has_value(), stated == 0);
    for (const Warning& warning : result.points.warnings)
      EXPECT_NE(warning.code, WarningCode::kFloorCuts) << warning.text;
    if (const auto& found = result.points.floor) {
      EXPECT_NEAR(found->floor.height(Vec3::Zero()), -kFloorHeight, 0.5);
    }
    for (const Vec3& x : result.shape.surface.measured.vertices) surface[stated].add(x);
    for (const Vec3& x : result.shape.surface.mesh.vertices)
      lowest[stated] = std::min(lowest[stated], x.z());
  }
  // Without a word of the floor it is found, its lines have their names, and it is measured like
  // the ball.
  EXPECT_GT(points[0].on_floor, points[0].on_ball / 50);
  EXPECT_GT(surface[0].on_floor, surface[0].on_ball / 500);
  EXPECT_EQ(points[1].on_floor, 0U);
  EXPECT_EQ(surface[1].on_floor, 0U);
  EXPECT_LT(points[1].in_air, points[0].in_air);
  // Single vertices where ball and floor meet.
  EXPECT_LE(surface[0].in_air, surface[0].on_ball / 20);
  EXPECT_LE(surface[1].in_air, surface[1].on_ball / 500);
  EXPECT_GT(points[1].on_ball, 98 * points[0].on_ball / 100);
  EXPECT_GT(surface[1].on_ball, surface[0].on_ball);
  EXPECT_GT(lowest[1], kFloorHeight - 0.1);
}

}  // namespace
}  // namespace pencilscan
