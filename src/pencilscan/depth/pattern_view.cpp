#include "pencilscan/depth/pattern_view.h"

#include <Eigen/LU>
#include <cmath>

namespace pencilscan {

TangentView::TangentView(const Camera& camera, const Vec3& point, const Vec3& normal) {
  const Vec3 local = camera.device_from_world * point;
  w = 1 / local.z();
  normalized = local.head<2>() * w;
  jacobian = camera.pixel_slope(normalized).inverse();
  // w = omega . (x, y, 1) on the plane, omega = n / (n . X).
  const Vec3 n = camera.device_from_world.rotation * normal;
  const Vec3 omega = n / n.dot(local);
  slope = (jacobian.transpose() * omega.head<2>()).cast<float>();
}

PatternView::PatternView(const Rig& rig, const Camera& camera, int projector, int pattern)
    : projector_(&rig.projectors[static_cast<std::size_t>(projector)]),
      pattern_(&projector_->patterns[static_cast<std::size_t>(pattern)]),
      projector_index_(projector),
      line_count_(projector_->line_count(*pattern_)),
      half_width_(static_cast<float>(0.5 * pattern_->line_width_px / pattern_->pitch_px)),
      projector_from_camera_(projector_->device_from_world * camera.device_from_world.inverse()),
      center_(camera.device_from_world * projector_->center()) {}

WindowLines PatternView::lines(const Vec2& m, const Eigen::Matrix2d& jacobian, double w,
                               bool& ok) const {
  WindowLines lines;
  // Rows of R m + t w over (1, dx, dy, w).
  Eigen::Matrix<double, 3, 4> rows;
  const Mat3& R = projector_from_camera_.rotation;
  rows.col(0) = R * m.homogeneous();
  rows.col(1) = R.leftCols<2>() * jacobian.col(0);
  rows.col(2) = R.leftCols<2>() * jacobian.col(1);
  rows.col(3) = projector_from_camera_.translation;
  const Vec3 x = rows.col(0) + w * rows.col(3);
  ok = x.z() > 0;
  if (!ok) return lines;
  const Vec2 ideal(x.x() / x.z(), x.y() / x.z());
  const auto axis = static_cast<Eigen::Index>(pattern_->axis);
  // Pixel = panel + J . (ideal - ideal0), J along the pattern's axis.
  const Vec2 panel = projector_->pixel_from_device(ideal.homogeneous());
  Vec2 J = projector_->pixel_slope(ideal).row(axis).transpose();
  const double line = pattern_->coordinate(panel[axis]);
  ok = line > -0.5 && line < line_count_ - 0.5;
  J /= pattern_->pitch_px;
  const Eigen::RowVector4d numerator =
      J[0] * rows.row(0) + J[1] * rows.row(1) + (line - J.dot(ideal)) * rows.row(2);
  const double scale = 1 / x.z();
  lines.n = (scale * numerator.transpose()).cast<float>();
  lines.d = (scale * rows.row(2).transpose()).cast<float>();
  // The other panel axis bounds the light too.
  const auto other = 1 - axis;
  const double along = panel[other];
  const int extent = other == 0 ? projector_->width : projector_->height;
  ok = ok && along > -0.5 && along < extent - 0.5;
  return lines;
}

}  // namespace pencilscan
