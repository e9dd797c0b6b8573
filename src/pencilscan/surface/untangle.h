#pragma once

#include <span>
#include <vector>

#include "pencilscan/geometry/mesh.h"

namespace pencilscan {

/// The faces of which an edge passes through another face, or through which another's edge passes,
/// in rising order. Faces with a common vertex do not count.
[[nodiscard]] std::vector<std::size_t> self_intersections(const TriangleMesh& mesh);

/// Mends moves of vertices that made the mesh cut itself: around faces that do, vertices first move
/// as their neighbours do; where that is not enough, they go half of the way back, again and again.
/// Coordinates become floats, as mesh files hold them: rounding can make faces cut each other, too.
/// `before`: positions of the vertices when the mesh did not cut itself. Returns how many faces
/// still do.
std::size_t untangle(std::span<const Vec3> before, TriangleMesh& mesh);

}  // namespace pencilscan
