#include "pencilscan/geometry/light_sheet.h"

#include <cmath>

namespace pencilscan {

Vec3 PencilOfPlanes::paper_plane(double c) const {
  const Eigen::Vector4d p = plane(c);
  return p.head<3>() / p(3);
}

PencilOfPlanes pencil_of_planes(const Device& camera, const Device& projector, Axis axis) {
  const RigidTransform projector_from_camera =
      projector.device_from_world * camera.device_from_world.inverse();
  Eigen::Matrix<double, 3, 4> P;
  P.leftCols<3>() = projector.K * projector_from_camera.rotation;
  P.col(3) = projector.K * projector_from_camera.translation;
  return {P.row(static_cast<int>(axis)).transpose(), -P.row(2).transpose()};
}

RayInProjector::RayInProjector(const Device& camera, const Device& projector,
                               const Vec2& camera_pixel)
    : RayInProjector(projector.device_from_world * camera.device_from_world.inverse(), projector,
                     camera.normalized_from_pixel(camera_pixel)) {}

RayInProjector::RayInProjector(const RigidTransform& projector_from_camera, const Device& projector,
                               const Vec2& normalized)
    : projector_(&projector),
      direction_(projector_from_camera.rotation * normalized.homogeneous()),
      origin_(projector_from_camera.translation) {}

std::optional<Vec2> RayInProjector::pixel(double depth) const {
  const Vec3 x = origin_ + depth * direction_;
  if (!(depth > 0 && x.z() > 0)) return std::nullopt;
  return projector_->pixel_from_device(x);
}

double RayInProjector::slope(double depth, Axis axis) const {
  const double step = 1e-4 * depth;
  const auto i = static_cast<Eigen::Index>(axis);
  const Vec3 ahead = origin_ + (depth + step) * direction_;
  const Vec3 behind = origin_ + (depth - step) * direction_;
  if (!(ahead.z() > 0 && behind.z() > 0)) return 0;
  return (projector_->pixel_from_device(ahead)[i] - projector_->pixel_from_device(behind)[i]) /
         (2 * step);
}

std::optional<double> RayInProjector::depth(double coordinate, Axis axis) const {
  const auto i = static_cast<Eigen::Index>(axis);
  // Row i of K minus coordinate times row 3, applied to origin + z * direction, is zero.
  const Vec3 row = projector_->K.row(i).transpose() - coordinate * Vec3::UnitZ();
  const double denominator = row.dot(direction_);
  if (denominator == 0) return std::nullopt;
  double z = -row.dot(origin_) / denominator;
  if (projector_->has_distortion()) {
    constexpr int kMaxIterations = 20;
    for (int k = 0; k < kMaxIterations; ++k) {
      const auto p = pixel(z);
      const double s = p ? slope(z, axis) : 0;
      if (s == 0) return std::nullopt;
      const double step = (coordinate - (*p)[i]) / s;
      z += step;
      if (std::abs(step) < 1e-10 * std::abs(z)) break;
    }
  }
  if (!(z > 0) || !((origin_ + z * direction_).z() > 0)) return std::nullopt;
  return z;
}

}  // namespace pencilscan
