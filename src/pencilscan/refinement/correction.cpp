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

RigidTransform corrected_pose(const Device& device, const PoseCorrection& correction) {
  const Mat3 turn = rotation_of(correction.rotation_px / device.focal_px());
  return {turn * device.device_from_world.rotation,
          turn * device.device_from_world.translation + correction.translation_mm};
}

PoseCorrection correction_to(const RigidTransform& pose, const Device& device) {
  const Mat3 turn = pose.rotation * device.device_from_world.rotation.transpose();
  const Eigen::AngleAxisd about(turn);
  return {device.focal_px() * about.angle() * about.axis(),
          pose.translation - turn * device.device_from_world.translation};
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
  return device.pixel_slope({x, y}) * normalized;
}

Eigen::Matrix<double, 3, 6> pose_jacobian(const Device& device, const PoseCorrection& correction,
                                          const Vec3& x_in_device) {
  // d exp(w) y / dw = -[exp(w) y]_x J(w) with the left Jacobian J(w) = I + [w]_x / 2 + O(w^2).
  const Vec3 turned = x_in_device - correction.translation_mm;
  const Vec3 w = correction.rotation_px / device.focal_px();
  Eigen::Matrix<double, 3, 6> jacobian;
  jacobian.leftCols<3>() =
      -cross_matrix(turned) * (Mat3::Identity() + 0.5 * cross_matrix(w)) / device.focal_px();
  jacobian.rightCols<3>().setIdentity();
  return jacobian;
}

}  // namespace pencilscan
