#include "pencilscan/paper/pencil_parameter.h"

#include <cmath>

namespace pencilscan {

PencilParameter::PencilParameter(const Rig& rig, const Camera& camera, PatternRef ref) {
  const Projector& projector = rig.projector(ref.projector);
  const LinePattern& pattern = rig.pattern(ref);
  const PencilOfPlanes pencil = pencil_of_planes(camera, projector, pattern.axis);
  const auto center = projector.project(working_volume(rig).center);
  const double center_px = center ? (*center)[static_cast<Eigen::Index>(pattern.axis)]
                                  : 0.5 * projector.size_across(pattern);
  reference_ = pattern.coordinate(center_px);
  const Eigen::Vector4d plane = pencil.plane(center_px);
  const Eigen::Vector4d slope = pencil.b * pattern.pitch_px;
  d0_ = plane(3);
  d_slope_ = slope(3);
  constexpr double kMinDistanceMm = 1e-6;
  usable_ = std::abs(d0_) > kMinDistanceMm * plane.head<3>().norm();
  if (!usable_) return;
  v0_ = plane.head<3>() / d0_;
  v_inf_ = (slope.head<3>() * d0_ - plane.head<3>() * d_slope_) / (d0_ * d0_);
}

double PencilParameter::line_from_mu(double mu) const {
  return reference_ + mu / (1 - mu * d_slope_ / d0_);
}

double PencilParameter::mu_from_line(double line) const {
  return (line - reference_) * d0_ / (d0_ + (line - reference_) * d_slope_);
}

}  // namespace pencilscan
