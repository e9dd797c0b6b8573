#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "pencilscan/geometry/types.h"

namespace pencilscan {

/// Most corners of a polygon that is not convex: its triangulation takes the cube of them at worst.
inline constexpr std::size_t kMostConcaveCorners = 1000;

/// The triangles of a polygon, as numbers of its corners, turning as it does: a fan from the first
/// corner where that is right (of every convex polygon), else ears cut off one by one (Meisters,
/// "Polygons have ears", American Mathematical Monthly 82, 1975). A polygon that crosses itself has
/// no right triangles and becomes a fan. `corners`: at most kMostConcaveCorners, or convex.
[[nodiscard]] std::vector<std::array<std::size_t, 3>> triangulated_polygon(
    std::span<const Vec3> corners);

/// False where the fan from the first corner would leave the polygon or cover it twice.
[[nodiscard]] bool is_fan(std::span<const Vec3> corners);

}  // namespace pencilscan
