#pragma once

#include <span>

#include "pencilscan/geometry/mesh.h"
#include "pencilscan/surface/lattice.h"

namespace pencilscan {

/// The surface between the nodes where `values` is > 0 (inside) and the others: marching cubes
/// (Lorensen and Cline 1987). Where a cell's face has two inside corners at opposite ends, they are
/// kept apart on both sides of the face, so that the surface has no edge of one face but where
/// cells are missing. `values`: one per node of the lattice. A node (x, y, z) lies at origin + cell
/// * (x, y, z). Vertices keep off the nodes by a fiftieth of a cell.
[[nodiscard]] TriangleMesh marching_cubes(const Lattice& lattice, std::span<const float> values,
                                          const Vec3& origin, double cell);

}  // namespace pencilscan
