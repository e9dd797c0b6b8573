#include "pencilscan/artefact/plane_fit.h"

#include "pencilscan/geometry/least_squares.h"

namespace pencilscan {

std::optional<Plane> fit_plane(std::span<const Vec3> points) {
  if (points.size() < 3) return std::nullopt;
  Vec3 mean = Vec3::Zero();
  for (const Vec3& point : points) mean += point / static_cast<double>(points.size());
  Mat3 moments = Mat3::Zero();
  for (const Vec3& point : points) moments += (point - mean) * (point - mean).transpose();
  const SymmetricEigen eigen = symmetric_eigen(moments);
  // On a line as far as floats tell.
  constexpr double kSingular = 1e-13;
  if (!(eigen.values(1) > kSingular * eigen.values(2))) return std::nullopt;
  return Plane{mean, eigen.vectors.col(0)};
}

}  // namespace pencilscan
