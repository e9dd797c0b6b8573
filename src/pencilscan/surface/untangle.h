#pragma once

#include <span>
#include <vector>

#include "pencilscan/geometry/mesh.h"

namespace pencilscan {

/// The faces of which an edge passes through another face, or through which another's edge passes,
/// in rising order. Faces with a common vertex do not count.
[[nodiscard]] std::vector<std::size_t> self_intersections(const TriangleMesh& mesh);

/// Repairs self-intersections that moving the vertices caused. Around faces that intersect,
/// vertices first take the mean move of their neighbours. Where that is not enough, they go half of
/// the way back, and again. Coordinates are rounded to floats as in mesh files, because rounding
/// can cause intersections, too. `before`: positions of the vertices when no faces intersected.
/// Returns how many faces still do.
std::size_t untangle(std::span<const Vec3> before, TriangleMesh& mesh);

}  // namespace pencilscan
