#pragma once

#include <optional>
#include <span>

#include "pencilscan/geometry/types.h"

namespace pencilscan {

/// The sphere that minimises sum_i (|p_i - c| - R)^2: geometric least squares, all points alike,
/// by Gauss-Newton. With n_i = (p_i - c) / |p_i - c| the residual r_i = |p_i - c| - R has the
/// derivative [-n_i', -1] by (c, R), so each step solves
///
///     sum [n_i n_i', n_i; n_i', 1] (dc, dR) = sum r_i (n_i, 1),
///
/// halved until the sum falls. `start` must lie roughly inside the points. With `radius` R is held
/// and the centre alone is free. Nothing where the points do not determine it: fewer than four
/// (three), or in one plane.
[[nodiscard]] std::optional<Sphere> fit_sphere(std::span<const Vec3> points, const Sphere& start,
                                               std::optional<double> radius = {});

/// The sphere through four points; nothing when they lie in a plane.
[[nodiscard]] std::optional<Sphere> sphere_through(const Vec3& a, const Vec3& b, const Vec3& c,
                                                   const Vec3& d);

/// |p - c| - R: positive outside.
[[nodiscard]] inline double signed_distance(const Sphere& sphere, const Vec3& point) {
  return (point - sphere.center).norm() - sphere.radius;
}

}  // namespace pencilscan
