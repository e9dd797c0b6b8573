#pragma once

#include "pencilscan/geometry/light_sheet.h"
#include "pencilscan/rig/rig.h"
#include "pencilscan/view/color_family.h"

namespace pencilscan {

/// The paper's parameter of a pencil of planes, v = v0 + mu v_inf (equations (2) and (3)), in the
/// frame of one camera.
///
/// With the plane (n, d)(c) of line coordinate c, p(c) = n(c) / d(c). For a reference c0,
///   p(c) - p(c0) = (c - c0) (n_b d0 - n0 d_b) / (d(c) d0),
/// where n_b, d_b are the slopes of n, d and d0 = d(c0). So v0 = p(c0), v_inf = (n_b d0 - n0 d_b) /
/// d0^2 and
///   mu = (c - c0) d0 / d(c),
/// which counts lines near c0. The reference is the line through the centre of the volume. Lens
/// distortion of the projector is not part of the pencil (the paper has none): it bends planes.
class PencilParameter {
 public:
  PencilParameter(const Rig& rig, const Camera& camera, PatternRef ref);

  [[nodiscard]] const Vec3& v0() const { return v0_; }
  [[nodiscard]] const Vec3& v_inf() const { return v_inf_; }
  [[nodiscard]] double line_from_mu(double mu) const;
  [[nodiscard]] double mu_from_line(double line) const;
  /// False when the planes hold the camera centre: the pencil says nothing about depth.
  [[nodiscard]] bool usable() const { return usable_; }

 private:
  Vec3 v0_ = Vec3::Zero();
  Vec3 v_inf_ = Vec3::Zero();
  double reference_ = 0;  ///< c0 in lines
  double d0_ = 1;
  double d_slope_ = 0;  ///< d d / d line
  bool usable_ = false;
};

}  // namespace pencilscan
