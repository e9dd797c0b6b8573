#pragma once

#include <optional>

#include "pencilscan/bundle/bundle.h"

namespace pencilscan {

inline constexpr double kLeastAngle = 0.02;  ///< rad between rays of a point that is used

/// Point nearest to the rays of the present devices; nothing when they are parallel or it lies
/// behind one.
[[nodiscard]] std::optional<Vec3> triangulate(const BundleProblem& problem, const Track& track,
                                              double least_angle_rad);
/// Points of all tracks anew; those without one become unused.
void triangulate_all(BundleProblem& problem, double least_angle_rad);

}  // namespace pencilscan
