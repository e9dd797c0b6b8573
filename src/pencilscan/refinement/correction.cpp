#include "pencilscan/refinement/correction.h"

#include <Eigen/Geometry>
#include <cmath>

#include "pencilscan/core/check.h"
#include "pencilscan/geometry/cross_matrix.h"

namespace pencilscan {
namespace {

Mat3 rotation_of(const Vec3& vector) {
  const double angle = vector.norm();
  if (angle == 0) return Mat3::Identity();
  return Eigen::AngleAxisd(angle, vector / angle).toRotationMatrix();
}

}  // namespace

double focal_px(const Device& device) { return 0.5 * (device.K(0, 0) + device.K(1, 1)); }

RigidTransform corrected_pose(const Device& device, const PoseCorrection& correction) {
  const Mat3 turn = rotation_of(correction.rotation_px / focal_px(device));
  return {turn * device.device_from_world.rotation,
          turn * device.device_from_world.translation + correction.translation_mm};
}

Rig corrected_rig(Rig rig, const RigCorrection& correction) {
  if (correction.empty()) return rig;
  PENCILSCAN_CHECK(correction.size() == device_count(rig));
  for (std::size_t d = 0; d < correction.size(); ++d) {
    Device& device = d < rig.cameras.size() ? static_cast<Device&>(rig.cameras[d])
                                            : rig.projectors[d - rig.cameras.size()];
    device.device_from_world = corrected_pose(device, correction[d]);
  }
  return rig;
}

Eigen::Matrix<double, 2, 3> projection_jacobian(const Device& device, const Vec3& x_in_device) {
  const double w = 1 / x_in_device.z();
  const double x = x_in_device.x() * w;
  const double y = x_in_device.y() * w;
  Eigen::Matrix<double, 2, 3> normalized;
  normalized << w, 0, -x * w, 0, w, -y * w;
  Eigen::Matrix2d K;
  K << device.K(0, 0), device.K(0, 1), 0, device.K(1, 1);
  if (!device.has_distortion()) return K * normalized;
  // Derivative of distort() (geometry/device.h).
  const auto [k1, k2, p1, p2, k3] = device.distortion;
  const double r2 = x * x + y * y;
  const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  const double radial_slope = k1 + r2 * (2 * k2 + 3 * k3 * r2);
  Eigen::Matrix2d distorted;
  distorted(0, 0) = radial + 2 * x * x * radial_slope + 2 * p1 * y + 6 * p2 * x;
  distorted(0, 1) = distorted(1, 0) = 2 * x * y * radial_slope + 2 * p1 * x + 2 * p2 * y;
  distorted(1, 1) = radial + 2 * y * y * radial_slope + 6 * p1 * y + 2 * p2 * x;
  return K * distorted * normalized;
}

Eigen::Matrix<double, 3, 6> pose_jacobian(const Device& device, const PoseCorrection& correction,
                                          const Vec3& x_in_device) {
  // d exp(w) y / dw = -[exp(w) y]_x J(w) with the left Jacobian J(w) = I + [w]_x / 2 + O(w^2).
  const Vec3 turned = x_in_device - correction.translation_mm;
  const Vec3 w = correction.rotation_px / focal_px(device);
  Eigen::Matrix<double, 3, 6> jacobian;
  jacobian.leftCols<3>() =
      -cross_matrix(turned) * (Mat3::Identity() + 0.5 * cross_matrix(w)) / focal_px(device);
  jacobian.rightCols<3>().setIdentity();
  return jacobian;
}

}  // namespace pencilscan
