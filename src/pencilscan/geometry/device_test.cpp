#include "pencilscan/geometry/device.h"

#include <gtest/gtest.h>

#include "pencilscan/core/random.h"

namespace pencilscan {
namespace {

Device wide_device() {
  Device device;
  device.width = 640;
  device.height = 480;
  device.K << 600, 0, 310, 0, 605, 250, 0, 0, 1;
  device.distortion = {-0.2, 0.05, 0.001, -0.002, 0.01};
  device.device_from_world = look_at({500, 200, 300}, {10, 0, 0}, 0.3);
  return device;
}

TEST(Device, RayPassesThroughTheProjectedPoint) {
  const Device device = wide_device();
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    const Vec3 x(random.uniform(-80, 80), random.uniform(-80, 80), random.uniform(-80, 80));
    const auto pixel = device.project(x);
    ASSERT_TRUE(pixel);
    const Ray ray = device.ray(*pixel);
    EXPECT_LT((x - ray.origin).cross(ray.direction).norm(), 1e-7);  // mm, Newton to 1e-12
  }
}

TEST(Device, PointBehindHasNoPixel) {
  const Device device = wide_device();
  EXPECT_FALSE(device.project(device.center() - 10 * device.forward()));
}

TEST(LookAt, PutsTheTargetOnTheAxisAndUpUp) {
  const RigidTransform pose = look_at({1000, 0, 300}, {0, 0, 0});
  const Vec3 target = pose * Vec3::Zero();
  EXPECT_NEAR(target.head<2>().norm(), 0, 1e-9);
  EXPECT_GT(target.z(), 0);
  EXPECT_LT((pose * Vec3(0, 0, 100)).y(), target.y());  // image y points down
  EXPECT_NEAR(pose.rotation.determinant(), 1, 1e-12);
}

}  // namespace
}  // namespace pencilscan
