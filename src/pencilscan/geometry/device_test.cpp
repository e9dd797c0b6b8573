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

const Distortion kRational{{-0.3, 0.1, 1e-3, -2e-3, 0.02, 0.25, -0.04, 0.01}};

TEST(Distortion, IsUndoneAndHasItsSlope) {
  for (const Distortion& lens : {wide_device().distortion, kRational}) {
    for (const Vec2& n : {Vec2(0, 0), Vec2(0.3, -0.2), Vec2(-0.5, 0.4)}) {
      EXPECT_LT((undistort(lens, distort(lens, n)) - n).norm(), 1e-11);
      constexpr double kStep = 1e-6;
      const Eigen::Matrix2d slope = distortion_slope(lens, n);
      for (int k = 0; k < 2; ++k) {
        const Vec2 step = kStep * Vec2::Unit(k);
        const Vec2 difference = (distort(lens, n + step) - distort(lens, n - step)) / (2 * kStep);
        EXPECT_LT((slope.col(k) - difference).norm(), 1e-8);
      }
    }
  }
}

// The formula of OpenCV's manual, written out for one point.
TEST(Distortion, IsOpencvsRationalModel) {
  const double r2 = 0.3 * 0.3 + 0.2 * 0.2;
  const double radial = (1 - 0.3 * r2 + 0.1 * r2 * r2 + 0.02 * r2 * r2 * r2) /
                        (1 + 0.25 * r2 - 0.04 * r2 * r2 + 0.01 * r2 * r2 * r2);
  const Vec2 shown = distort(kRational, {0.3, -0.2});
  EXPECT_NEAR(shown.x(), 0.3 * radial - 2e-3 * 0.3 * 0.2 - 2e-3 * (r2 + 2 * 0.09), 1e-15);
  EXPECT_NEAR(shown.y(), -0.2 * radial + 1e-3 * (r2 + 2 * 0.04) + 4e-3 * 0.3 * 0.2, 1e-15);
}

TEST(Device, PixelSlopeIsTheDerivativeOfProjection) {
  Device device = wide_device();
  device.distortion = kRational;
  const Vec2 n(0.2, -0.1);
  constexpr double kStep = 1e-6;
  for (int k = 0; k < 2; ++k) {
    const Vec2 step = kStep * Vec2::Unit(k);
    const Vec2 difference = (device.pixel_from_device((n + step).homogeneous()) -
                             device.pixel_from_device((n - step).homogeneous())) /
                            (2 * kStep);
    EXPECT_LT((device.pixel_slope(n).col(k) - difference).norm(), 1e-5);
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
