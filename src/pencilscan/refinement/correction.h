#pragma once

#include <vector>

#include "pencilscan/rig/device_list.h"

namespace pencilscan {

/// A small change of a device's pose, in its own frame: with y = R x_world + t as calibrated,
/// x_device = exp([rotation_px / f]_x) y + translation_mm. Rotations count in pixels at the image
/// centre, f = (fx + fy) / 2, so that devices of all resolutions compare.
struct PoseCorrection {
  Vec3 rotation_px = Vec3::Zero();
  Vec3 translation_mm = Vec3::Zero();
};

/// One per device (device_list.h).
using RigCorrection = std::vector<PoseCorrection>;

/// The calibrated pose with its correction.
[[nodiscard]] RigidTransform corrected_pose(const Device& device, const PoseCorrection& correction);
/// The correction that gives a device this pose: the inverse of corrected_pose(), turned by less
/// than half a circle.
[[nodiscard]] PoseCorrection correction_to(const RigidTransform& pose, const Device& device);
/// The rig with all poses corrected; correction is empty or has one entry per device.
[[nodiscard]] Rig corrected_rig(Rig rig, const RigCorrection& correction);

/// d(pixel) / d(point in the device's frame), 2 x 3, px per mm: derivative of
/// Device::pixel_from_device.
[[nodiscard]] Eigen::Matrix<double, 2, 3> projection_jacobian(const Device& device,
                                                              const Vec3& x_in_device);

/// d(x_device) / d(rotation_px, translation_mm), 3 x 6, where x_in_device is the corrected point.
[[nodiscard]] Eigen::Matrix<double, 3, 6> pose_jacobian(const Device& device,
                                                        const PoseCorrection& correction,
                                                        const Vec3& x_in_device);

}  // namespace pencilscan
