#pragma once

#include <Eigen/Core>
#include <vector>

#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// The line coordinate of one pattern over a small window of a camera image, as a ratio of affine
/// functions of the pixel and of inverse depth w:
///   l(dx, dy, w) = (n0 + n1 dx + n2 dy + n3 w) / (d0 + d1 dx + d2 dy + d3 w).
/// Exact for pinholes (a projector pixel is K (R m + t w) up to scale for the normalised camera
/// pixel m); lenses are linearised at the window's centre.
struct WindowLines {
  Eigen::Vector4f n = Eigen::Vector4f::Zero();
  Eigen::Vector4f d = Eigen::Vector4f::Zero();

  [[nodiscard]] float denominator(float dx, float dy, float w) const {
    return d[0] + d[1] * dx + d[2] * dy + d[3] * w;
  }
  [[nodiscard]] float line(float dx, float dy, float w) const {
    return (n[0] + n[1] * dx + n[2] * dy + n[3] * w) / denominator(dx, dy, w);
  }
  /// dl / dw at the centre.
  [[nodiscard]] float slope(float w) const {
    const float den = denominator(0, 0, w);
    return (n[3] - line(0, 0, w) * d[3]) / den;
  }
  /// (dl / du, dl / dv) at the centre of a surface with the inverse-depth gradient (wx, wy).
  [[nodiscard]] Eigen::Vector2f gradient(float w, float wx, float wy) const {
    const float den = denominator(0, 0, w);
    const float l = line(0, 0, w);
    const float s = slope(w);
    return {(n[1] - l * d[1]) / den + s * wx, (n[2] - l * d[2]) / den + s * wy};
  }
};

/// A place of a surface as a camera without lens distortion sees it: what PatternView::lines() asks
/// for, with the inverse depth of its tangent plane.
struct TangentView {
  Vec2 normalized;           ///< camera coordinates
  Eigen::Matrix2d jacobian;  ///< d normalized / d pixel
  double w = 0;              ///< inverse depth, 1/mm
  Eigen::Vector2f slope;     ///< d w / d pixel

  /// At a point (world, mm) with a unit normal.
  TangentView(const Camera& camera, const Vec3& point, const Vec3& normal);
};

/// One pattern as one camera sees it.
class PatternView {
 public:
  PatternView(const Rig& rig, const Camera& camera, int projector, int pattern);

  /// Lines around a pixel with normalised coordinates m and d m / d pixel = jacobian, linearised at
  /// inverse depth w. Nothing behind the projector or off its panel: ok is false.
  [[nodiscard]] WindowLines lines(const Vec2& m, const Eigen::Matrix2d& jacobian, double w,
                                  bool& ok) const;

  [[nodiscard]] int projector() const { return projector_index_; }
  [[nodiscard]] const LinePattern& pattern() const { return *pattern_; }
  /// Half the width of a line, in lines.
  [[nodiscard]] float half_width() const { return half_width_; }
  /// Projector centre in the camera frame, mm.
  [[nodiscard]] const Vec3& center() const { return center_; }
  [[nodiscard]] int family() const { return family_; }
  void set_family(int family) { family_ = family; }

 private:
  const Projector* projector_;
  const LinePattern* pattern_;
  int projector_index_;
  int family_ = 0;
  int line_count_;
  float half_width_;
  RigidTransform projector_from_camera_;
  Vec3 center_;
};

}  // namespace pencilscan
