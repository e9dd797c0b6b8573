#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "pencilscan/artefact/plane_fit.h"
#include "pencilscan/geometry/types.h"

namespace pencilscan {

// The shape on which most points lie, among points that may hold anything else: of many drawn
// through as few points as determine one (RANSAC: Fischler, Bolles, CACM 24 (6), 1981). Rough: a
// start for a fit by least squares.

/// By so much of its expected size may a sphere differ: the scale of a scanner is off by some per
/// cent at most, and units that are mixed up differ by a factor of 2.5 and more.
inline constexpr double kSizeTolerance = 0.1;
/// Points vote for a sphere from which they are less than this off, of its expected radius.
inline constexpr double kOnSphere = 0.02;

/// Where to look for a sphere.
struct SphereSearch {
  std::optional<double> radius;  ///< expected; spheres that differ by > kSizeTolerance are ignored
  std::optional<Sphere> not_here;  ///< centres inside this are ignored
  std::uint64_t seed = 1;
};

/// Points vote for a sphere from which they are less than kOnSphere of the expected radius off, or
/// 1 % of their extent where none is expected. Nothing where no sphere was found.
[[nodiscard]] std::optional<Sphere> find_sphere(std::span<const Vec3> points,
                                                const SphereSearch& search = {});

/// Points vote for a plane from which they are less than `tolerance` off; 1 % of their extent
/// without one. Nothing where they lie on a line.
[[nodiscard]] std::optional<Plane> find_plane(std::span<const Vec3> points, std::uint64_t seed = 1,
                                              std::optional<double> tolerance = {});

}  // namespace pencilscan
