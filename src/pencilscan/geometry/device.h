#pragma once

#include <optional>
#include <string>

#include "pencilscan/geometry/distortion.h"
#include "pencilscan/geometry/types.h"

namespace pencilscan {

/// A camera or a projector: a pinhole with lens distortion (OpenCV's model and axes:
/// x right, y down, z forward; pixel centres at integers). A projector is a camera that shines.
struct Device {
  std::string name;
  int width = 0;              ///< px, >= 1
  int height = 0;             ///< px, >= 1
  Mat3 K = Mat3::Identity();  ///< upper triangular, K(2,2) = 1, focal > 0
  Distortion distortion;
  RigidTransform device_from_world;

  [[nodiscard]] bool has_distortion() const { return !distortion.is_none(); }
  /// Focal length, the mean of both directions: at depth z a pixel covers z / focal_px().
  [[nodiscard]] double focal_px() const { return 0.5 * (K(0, 0) + K(1, 1)); }
  [[nodiscard]] Vec3 center() const;  ///< in world, mm
  [[nodiscard]] Vec3 forward() const { return device_from_world.rotation.row(2).transpose(); }
  /// Pixel of a world point; nothing when the point is not in front of the device, or so far out
  /// that the lens model turns back: its formula would show it among what lies further in.
  [[nodiscard]] std::optional<Vec2> project(const Vec3& x_in_world) const;
  /// Pixel of a point given in the device's own frame, z > 0.
  [[nodiscard]] Vec2 pixel_from_device(const Vec3& x_in_device) const;
  /// Undistorted normalised coordinates (z = 1) of a pixel.
  [[nodiscard]] Vec2 normalized_from_pixel(const Vec2& pixel) const;
  /// Derivative of pixel_from_device(): d pixel / d undistorted normalised coordinates.
  [[nodiscard]] Eigen::Matrix2d pixel_slope(const Vec2& normalized) const;
  /// World ray through a pixel, from the centre.
  [[nodiscard]] Ray ray(const Vec2& pixel) const;
  /// World point at camera z = depth on the ray of a pixel.
  [[nodiscard]] Vec3 point_at_depth(const Vec2& pixel, double depth) const;
  /// True inside [-0.5, width - 0.5] x [-0.5, height - 0.5].
  [[nodiscard]] bool contains(const Vec2& pixel) const;
};

/// Pose of a device at `eye` that looks at `target`, its image upright for world z = up, then
/// rolled clockwise by roll_rad as seen in the image.
[[nodiscard]] RigidTransform look_at(const Vec3& eye, const Vec3& target, double roll_rad = 0);

}  // namespace pencilscan
