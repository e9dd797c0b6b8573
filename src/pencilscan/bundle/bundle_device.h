#pragma once

#include <array>

#include "pencilscan/geometry/device.h"

namespace pencilscan {

/// Inner parameters of a device, in this order.
enum Intrinsic { kFx, kFy, kCx, kCy, kK1, kK2, kP1, kP2, kK3, kIntrinsics };
inline constexpr std::array<const char*, kIntrinsics> kIntrinsicNames{"fx", "fy", "cx", "cy", "k1",
                                                                      "k2", "p1", "p2", "k3"};

/// What K and the lens have beyond the inner parameters: held as given, never adjusted.
struct HeldInner {
  std::array<double, 3> denominator{};  ///< k4, k5, k6 (geometry/distortion.h)
  double skew = 0;                      ///< K(0, 1), px
};

/// A device as the adjustment sees it.
struct BundleDevice {
  int width = 0;                 ///< px, >= 1
  int height = 0;                ///< px, >= 1
  std::array<double, 6> pose{};  ///< device_from_world: angle-axis, then translation
  std::array<double, kIntrinsics> inner{};
  /// What is known beforehand: value and one standard deviation (0: held exactly at the value;
  /// infinity: nothing known). fy's is on fy / fx.
  std::array<double, kIntrinsics> prior{};
  std::array<double, kIntrinsics> prior_sigma{};
  bool is_K_given = false;  ///< priors of fx, cx and cy are those of a K that was given
  HeldInner held;
  bool present = false;  ///< has a pose and takes part
};

/// With its values as prior, held exactly, and not present.
[[nodiscard]] BundleDevice bundle_device(const Device& device);
/// Writes K, distortion and pose back.
void set_device(const BundleDevice& from, Device& device);

/// device_from_world.
void set_pose(BundleDevice& device, const Mat3& rotation, const Vec3& translation);

/// The lens of inner parameters and a denominator.
[[nodiscard]] inline std::array<double, Distortion::kCoefficients> lens_coefficients(
    const double* inner, const std::array<double, 3>& denominator) {
  return {inner[kK1], inner[kK2],     inner[kP1],     inner[kP2],
          inner[kK3], denominator[0], denominator[1], denominator[2]};
}

[[nodiscard]] Mat3 K_of(const BundleDevice& device);

/// Direction (z = 1) of a pixel in the device's frame.
[[nodiscard]] Vec3 device_ray(const BundleDevice& device, const Vec2& pixel);
/// Poses as the adjustment holds them (angle-axis, then translation), and back.
[[nodiscard]] RigidTransform transform_from(const std::array<double, 6>& pose);
[[nodiscard]] std::array<double, 6> pose_from(const RigidTransform& transform);
[[nodiscard]] Mat3 rotation_of(const BundleDevice& device);
[[nodiscard]] Vec3 center_of(const BundleDevice& device);

}  // namespace pencilscan
