#pragma once

#include <optional>
#include <span>

#include "pencilscan/geometry/types.h"

namespace pencilscan {

struct Plane {
  Vec3 point = Vec3::Zero();
  Vec3 normal = Vec3::UnitZ();  ///< unit

  [[nodiscard]] double signed_distance(const Vec3& x) const { return normal.dot(x - point); }
};

/// The plane that minimises the sum of squared distances: through the mean of the points, its
/// normal the direction in which they spread least (the last right singular vector of the points
/// without their mean). Nothing where they do not determine it: fewer than three, or on a line.
[[nodiscard]] std::optional<Plane> fit_plane(std::span<const Vec3> points);

}  // namespace pencilscan
