#include "pencilscan/bundle/bundle_device.h"

#include <ceres/rotation.h>

#include <algorithm>

namespace pencilscan {

BundleDevice bundle_device(const Device& device) {
  BundleDevice result;
  result.width = device.width;
  result.height = device.height;
  const Mat3& R = device.device_from_world.rotation;
  ceres::RotationMatrixToAngleAxis(R.data(), result.pose.data());  // Eigen is column major, too
  for (Eigen::Index i = 0; i < 3; ++i)
    result.pose[static_cast<std::size_t>(3 + i)] = device.device_from_world.translation[i];
  const auto& k = device.distortion;
  result.inner = {
      device.K(0, 0), device.K(1, 1), device.K(0, 2), device.K(1, 2), k[0], k[1], k[2], k[3], k[4]};
  result.held = {{k[5], k[6], k[7]}, device.K(0, 1)};
  result.prior = result.inner;
  result.prior[kFy] = result.inner[kFy] / result.inner[kFx];
  return result;
}

void set_pose(BundleDevice& device, const Mat3& rotation, const Vec3& translation) {
  ceres::RotationMatrixToAngleAxis(rotation.data(), device.pose.data());
  for (Eigen::Index i = 0; i < 3; ++i)
    device.pose[static_cast<std::size_t>(3 + i)] = translation[i];
}

Mat3 K_of(const BundleDevice& device) {
  const auto& inner = device.inner;
  Mat3 K;
  K << inner[kFx], device.held.skew, inner[kCx], 0, inner[kFy], inner[kCy], 0, 0, 1;
  return K;
}

void set_device(const BundleDevice& from, Device& device) {
  device.K = K_of(from);
  device.distortion = {lens_coefficients(from.inner.data(), from.held.denominator)};
  ceres::AngleAxisToRotationMatrix(from.pose.data(), device.device_from_world.rotation.data());
  device.device_from_world.translation = Vec3(from.pose[3], from.pose[4], from.pose[5]);
}

RigidTransform transform_from(const std::array<double, 6>& pose) {
  RigidTransform transform;
  ceres::AngleAxisToRotationMatrix(pose.data(), transform.rotation.data());
  transform.translation = Vec3(pose[3], pose[4], pose[5]);
  return transform;
}

std::array<double, 6> pose_from(const RigidTransform& transform) {
  std::array<double, 6> pose{};
  ceres::RotationMatrixToAngleAxis(transform.rotation.data(), pose.data());
  std::copy_n(transform.translation.data(), 3, pose.begin() + 3);
  return pose;
}

Mat3 rotation_of(const BundleDevice& device) { return transform_from(device.pose).rotation; }

Vec3 center_of(const BundleDevice& device) {
  return -rotation_of(device).transpose() * Vec3(device.pose[3], device.pose[4], device.pose[5]);
}

Vec3 device_ray(const BundleDevice& device, const Vec2& pixel) {
  const double y = (pixel.y() - device.inner[kCy]) / device.inner[kFy];
  const Vec2 bent((pixel.x() - device.inner[kCx] - device.held.skew * y) / device.inner[kFx], y);
  const Vec2 straight =
      undistort({lens_coefficients(device.inner.data(), device.held.denominator)}, bent);
  return straight.allFinite() && straight.norm() < 10 ? straight.homogeneous() : bent.homogeneous();
}

}  // namespace pencilscan
