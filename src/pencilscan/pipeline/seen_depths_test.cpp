#include "pencilscan/pipeline/seen_depths.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "pencilscan/core/random.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

TEST(SeenDepths, AreTheNearestAndFarthestOfEachCell) {
  const Rig rig = sample::small_rig(100, 75, 110);  // no whole number of cells
  const Camera& camera = rig.cameras[0];
  for (const int cell_px : {8, 16}) {
    SeenDepths depths(camera, cell_px);
    struct Seen {
      Vec2 pixel;
      double depth;
    };
    std::vector<Seen> all;
    Random random(2);
    for (int i = 0; i < 300; ++i) {
      all.push_back(
          {{random.uniform(-0.5, 99.5), random.uniform(-0.5, 74.5)}, random.uniform(500, 600)});
      depths.add(all.back().pixel, all.back().depth);
    }
    // Truncation is what makes the half pixel before 0 part of the first cell.
    const auto cell = [&](const Vec2& pixel) {
      return std::pair(static_cast<int>(pixel.x() / cell_px),
                       static_cast<int>(pixel.y() / cell_px));
    };
    for (const Seen& seen : all) {
      double nearest = seen.depth;
      double farthest = seen.depth;
      for (const Seen& other : all) {
        if (cell(other.pixel) != cell(seen.pixel)) continue;
        nearest = std::min(nearest, other.depth);
        farthest = std::max(farthest, other.depth);
      }
      const SeenDepths::Range* range = depths.at(seen.pixel);
      ASSERT_NE(range, nullptr);
      EXPECT_EQ(range->nearest, nearest);
      EXPECT_EQ(range->farthest, farthest);
    }
  }
}

TEST(SeenDepths, AreNoneWhereNothingWasSeenOrBesideThePicture) {
  const Rig rig = sample::small_rig(96, 72, 110);
  SeenDepths depths(rig.cameras[0], 8);
  EXPECT_EQ(depths.at({20, 20}), nullptr);
  for (const Vec2& beside : {Vec2(-0.6, 20), Vec2(20, -0.6), Vec2(1e9, 20), Vec2(20, 1e9),
                             Vec2(std::nan(""), 20), Vec2(20, std::nan(""))}) {
    depths.add(beside, 500);
    EXPECT_EQ(depths.at(beside), nullptr) << beside.transpose();
  }
  depths.add({16, 16}, 500);
  ASSERT_NE(depths.at({23.9, 23.9}), nullptr);
  EXPECT_EQ(depths.at({24, 20}), nullptr);
  EXPECT_EQ(depths.at({15.9, 20}), nullptr);
}

TEST(AboutFacing, IsTheMiddleOfTheCameraAndTheProjector) {
  const Rig rig = sample::small_rig(96, 72, 110);
  MeasuredPoint p;
  set_position({3, -2, 5}, p);
  p.camera = 1;
  p.projector = 1;
  const Vec3 facing = about_facing(rig, p);
  EXPECT_NEAR(facing.norm(), 1, 1e-12);
  const Vec3 x = position_of(p);
  const Vec3 to_camera = (rig.cameras[1].center() - x).normalized();
  const Vec3 to_light = (rig.projectors[1].center() - x).normalized();
  EXPECT_NEAR(facing.dot(to_camera), facing.dot(to_light), 1e-12);
  EXPECT_NEAR(facing.dot(to_camera.cross(to_light)), 0, 1e-12);
  EXPECT_GT(facing.dot(to_camera), 0);
}

}  // namespace
}  // namespace pencilscan
