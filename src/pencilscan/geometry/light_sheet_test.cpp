#include "pencilscan/geometry/light_sheet.h"

#include <gtest/gtest.h>

namespace pencilscan {
namespace {

struct Pair {
  Device camera;
  Device projector;
};

Pair make_pair(bool distorted) {
  Pair pair;
  pair.camera.width = 1280;
  pair.camera.height = 960;
  pair.camera.K << 2300, 0, 640, 0, 2300, 480, 0, 0, 1;
  pair.camera.device_from_world = look_at({1100, 0, 200}, Vec3::Zero());
  pair.projector = pair.camera;
  pair.projector.device_from_world = look_at({900, 600, 300}, Vec3::Zero(), 0.2);
  if (distorted) {
    pair.camera.distortion = {-0.1, 0.02, 0.001, 0, 0};
    pair.projector.distortion = {0.08, -0.01, 0, 0.002, 0};
  }
  return pair;
}

TEST(RayInProjector, DepthInvertsPixelWithAndWithoutDistortion) {
  for (const bool distorted : {false, true}) {
    const Pair pair = make_pair(distorted);
    const RayInProjector ray(pair.camera, pair.projector, {700, 400});
    for (const double depth : {950.0, 1100.0, 1250.0}) {
      const auto pixel = ray.pixel(depth);
      ASSERT_TRUE(pixel);
      for (const Axis axis : {Axis::kColumn, Axis::kRow}) {
        const auto back = ray.depth((*pixel)[static_cast<int>(axis)], axis);
        ASSERT_TRUE(back);
        EXPECT_NEAR(*back, depth, 1e-6);
      }
    }
  }
}

TEST(PencilOfPlanes, PaperPlaneHoldsThePointsOfTheLine) {
  const Pair pair = make_pair(false);
  const PencilOfPlanes pencil = pencil_of_planes(pair.camera, pair.projector, Axis::kRow);
  const RayInProjector ray(pair.camera, pair.projector, {600, 500});
  const double depth = ray.depth(480, Axis::kRow).value();
  const Vec3 x = depth * pair.camera.normalized_from_pixel({600, 500}).homogeneous();
  EXPECT_NEAR(pencil.paper_plane(480).dot(x) + 1, 0, 1e-9);  // equation (1)
}

}  // namespace
}  // namespace pencilscan
