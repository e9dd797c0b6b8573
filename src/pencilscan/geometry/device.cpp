#include "pencilscan/geometry/device.h"

#include <algorithm>
#include <cmath>

namespace pencilscan {

bool Device::has_distortion() const {
  return std::any_of(distortion.begin(), distortion.end(), [](double k) { return k != 0; });
}

Vec3 Device::center() const { return device_from_world.inverse().translation; }

std::optional<Vec2> Device::project(const Vec3& x_in_world) const {
  const Vec3 x = device_from_world * x_in_world;
  if (!(x.z() > 0)) return std::nullopt;
  return pixel_from_device(x);
}

Vec2 Device::pixel_from_device(const Vec3& x_in_device) const {
  Vec2 n = x_in_device.head<2>() / x_in_device.z();
  if (has_distortion()) n = distort(distortion, n);
  return {K(0, 0) * n.x() + K(0, 1) * n.y() + K(0, 2), K(1, 1) * n.y() + K(1, 2)};
}

Vec2 Device::normalized_from_pixel(const Vec2& pixel) const {
  const double y = (pixel.y() - K(1, 2)) / K(1, 1);
  const double x = (pixel.x() - K(0, 2) - K(0, 1) * y) / K(0, 0);
  return has_distortion() ? undistort(distortion, {x, y}) : Vec2(x, y);
}

Ray Device::ray(const Vec2& pixel) const {
  const Vec3 direction_in_device = normalized_from_pixel(pixel).homogeneous();
  return {center(), (device_from_world.rotation.transpose() * direction_in_device).normalized()};
}

Vec3 Device::point_at_depth(const Vec2& pixel, double depth) const {
  const Vec3 x_in_device = depth * normalized_from_pixel(pixel).homogeneous();
  return device_from_world.inverse() * x_in_device;
}

bool Device::contains(const Vec2& pixel) const {
  return pixel.x() >= -0.5 && pixel.x() <= width - 0.5 && pixel.y() >= -0.5 &&
         pixel.y() <= height - 0.5;
}

Vec2 distort(const std::array<double, 5>& distortion, const Vec2& normalized) {
  const auto [k1, k2, p1, p2, k3] = distortion;
  const double x = normalized.x();
  const double y = normalized.y();
  const double r2 = x * x + y * y;
  const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  return {x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
          y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
}

Vec2 undistort(const std::array<double, 5>& distortion, const Vec2& distorted) {
  const auto [k1, k2, p1, p2, k3] = distortion;
  Vec2 n = distorted;
  constexpr int kMaxIterations = 20;
  for (int i = 0; i < kMaxIterations; ++i) {
    const double x = n.x();
    const double y = n.y();
    const double r2 = x * x + y * y;
    const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
    const double radial_slope = k1 + r2 * (2 * k2 + 3 * k3 * r2);  // d radial / d r^2
    Eigen::Matrix2d jacobian;
    jacobian(0, 0) = radial + 2 * x * x * radial_slope + 2 * p1 * y + 6 * p2 * x;
    jacobian(0, 1) = 2 * x * y * radial_slope + 2 * p1 * x + 2 * p2 * y;
    jacobian(1, 0) = jacobian(0, 1);
    jacobian(1, 1) = radial + 2 * y * y * radial_slope + 6 * p1 * y + 2 * p2 * x;
    const Vec2 step = jacobian.inverse() * (distorted - distort(distortion, n));
    n += step;
    if (step.squaredNorm() < 1e-26) break;
  }
  return n;
}

RigidTransform look_at(const Vec3& eye, const Vec3& target, double roll_rad) {
  const Vec3 forward = (target - eye).normalized();
  Vec3 right = forward.cross(Vec3::UnitZ());
  if (right.norm() < 1e-9) right = Vec3::UnitX();
  right.normalize();
  const Vec3 down = forward.cross(right);
  Mat3 rotation;
  rotation.row(0) = std::cos(roll_rad) * right + std::sin(roll_rad) * down;
  rotation.row(1) = -std::sin(roll_rad) * right + std::cos(roll_rad) * down;
  rotation.row(2) = forward;
  return {rotation, -(rotation * eye)};
}

}  // namespace pencilscan
