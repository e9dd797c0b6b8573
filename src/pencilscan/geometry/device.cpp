#include "pencilscan/geometry/device.h"

#include <cmath>

namespace pencilscan {

Vec3 Device::center() const { return device_from_world.inverse().translation; }

std::optional<Vec2> Device::project(const Vec3& x_in_world) const {
  const Vec3 x = device_from_world * x_in_world;
  if (!(x.z() > 0)) return std::nullopt;
  if (has_distortion() && !(distortion_slope(distortion, x.head<2>() / x.z()).determinant() > 0))
    return std::nullopt;
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

Eigen::Matrix2d Device::pixel_slope(const Vec2& normalized) const {
  const Eigen::Matrix2d k = K.topLeftCorner<2, 2>();
  if (!has_distortion()) return k;
  return k * distortion_slope(distortion, normalized);
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
