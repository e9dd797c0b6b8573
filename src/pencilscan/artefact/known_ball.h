#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "pencilscan/geometry/types.h"

// Whether points lie on a ball of known size, and where they lie on none, whether they would in
// another unit.

namespace pencilscan {

/// Whether a point counts as on the ball: off by less than a twentieth of the radius, more than
/// twice what a vote allows (find_shapes.h).
[[nodiscard]] bool is_near(const Sphere& sphere, const Vec3& point);
/// A found sphere refined by the points near it alone, so that stems and bars do not pull at it.
[[nodiscard]] Sphere refined(std::span<const Vec3> points, const Sphere& found);
/// To within kSizeTolerance.
[[nodiscard]] bool has_size(const Sphere& sphere, double radius);
/// Whether a ball was found, and not some points of another thing that lie on one by chance: of
/// balls that hold fewer than a quarter of the points the search cannot be sure (find_shapes.cpp).
[[nodiscard]] bool is_ball(std::span<const Vec3> points, const Sphere& found, double radius);

/// "; one of 0.05 mm does: the points are probably in metres instead of millimetres, multiply them
/// by 1000" or that --diameter is, of points on which no ball of this diameter lies; empty where
/// no unit explains it.
[[nodiscard]] std::string unit_advice(std::span<const Vec3> points, double diameter_mm,
                                      std::uint64_t seed);

}  // namespace pencilscan
