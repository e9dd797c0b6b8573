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

/// Where to look for a sphere.
struct SphereSearch {
  std::optional<double> radius;  ///< expected; spheres that differ by more than a tenth are ignored
  std::optional<Sphere> not_here;  ///< centres inside this are ignored
  std::uint64_t seed = 1;
};

/// Points vote for a sphere from which they are less than 2 % of the expected radius off, or 1 % of
/// their extent where none is expected. Nothing where no sphere was found.
[[nodiscard]] std::optional<Sphere> find_sphere(std::span<const Vec3> points,
                                                const SphereSearch& search = {});

/// Points vote for a plane from which they are less than `tolerance` off; 1 % of their extent
/// without one. Nothing where they lie on a line.
[[nodiscard]] std::optional<Plane> find_plane(std::span<const Vec3> points, std::uint64_t seed = 1,
                                              std::optional<double> tolerance = {});

}  // namespace pencilscan
