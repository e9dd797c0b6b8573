#pragma once

#include <optional>

#include "pencilscan/geometry/device.h"

namespace pencilscan {

/// Which projector coordinate a pattern's lines count along: the column for vertical lines.
enum class Axis { kColumn = 0, kRow = 1 };

/// A pencil of planes in a camera's frame (equations (1)-(3) of the paper): the plane of the line
/// at projector coordinate c (px) is w(u) = omega(c) . u with u = (x, y, 1) the normalised pixel
/// and w = 1 / z the inverse depth of the point where the camera ray meets the plane. In the
/// paper's form p'x + 1 = 0 this is omega = -p, hence v = v0 + mu v_inf.
///
/// With the plane pi(c) = a + c b (4-vectors, rows of the projector's 3x4 matrix in the camera
/// frame: b = -P row 3, a = P row 1 or 2) every c gives n . x + d = 0, so omega(c) = -n(c) / d(c).
/// Valid without lens distortion of the projector; RayInProjector below is exact with it.
struct PencilOfPlanes {
  Eigen::Vector4d a = Eigen::Vector4d::Zero();
  Eigen::Vector4d b = Eigen::Vector4d::Zero();

  /// Plane (n, d) of coordinate c, n . x + d = 0 in the camera frame.
  [[nodiscard]] Eigen::Vector4d plane(double c) const { return a + c * b; }
  /// Paper's (p1, p2, p3): p . x + 1 = 0. Undefined for a plane through the camera centre.
  [[nodiscard]] Vec3 paper_plane(double c) const;
};

/// The planes of the projector's columns (or rows) in the camera's frame, mm. Lens distortion of
/// the projector is left out.
[[nodiscard]] PencilOfPlanes pencil_of_planes(const Device& camera, const Device& projector,
                                              Axis axis);

/// How the projector coordinate varies along one camera ray. Along the ray of a camera pixel, the
/// (undistorted) projector coordinates are a ratio of affine functions of inverse depth w = 1 / z:
/// x_p = (A w + B), projected. Handles distortion on both sides exactly.
class RayInProjector {
 public:
  RayInProjector(const Device& camera, const Device& projector, const Vec2& camera_pixel);
  /// The same for many pixels of one camera: its ray through (x, y, 1).
  RayInProjector(const RigidTransform& projector_from_camera, const Device& projector,
                 const Vec2& normalized);

  /// Projector pixel of the point at camera depth z; nothing behind the projector.
  [[nodiscard]] std::optional<Vec2> pixel(double depth) const;
  /// d(projector coordinate along axis)/d(depth) in px per mm at `depth`.
  [[nodiscard]] double slope(double depth, Axis axis) const;
  /// Camera depth where the ray meets the light sheet of projector coordinate c; closed form
  /// without distortion, Newton on top with it. Nothing when it meets it behind either device.
  [[nodiscard]] std::optional<double> depth(double coordinate, Axis axis) const;

 private:
  const Device* projector_;
  Vec3 direction_;  ///< camera ray (z = 1) in the projector frame
  Vec3 origin_;     ///< camera centre in the projector frame, mm
};

}  // namespace pencilscan
