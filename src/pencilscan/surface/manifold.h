#pragma once

#include <cstddef>

#include "pencilscan/geometry/mesh.h"

namespace pencilscan {

/// Cuts a closed mesh apart where it only touches itself, so that every edge has two faces and the
/// faces of every vertex are one fan ("cutting", A. Gueziec, G. Taubin, F. Lazarus, W. Horn,
/// "Cutting and stitching: converting sets of polygons to manifold surfaces", IEEE TVCG 7(2),
/// 2001). Of the faces around an edge, the two that bound the same solid wedge stay together.
/// Copies of a vertex move into their own solid by a small share of their edges: no two vertices
/// are at one place. Where one fan of faces passes an edge twice, a new vertex on it tells the two
/// apart. Faces and vertices keep their order, new ones follow. Returns the number of new vertices.
std::size_t make_manifold(TriangleMesh& mesh);

/// Moves vertices apart that are at one place as floats hold it, as mesh files do, by the least
/// that floats allow; coordinates become floats. Returns how many moved.
std::size_t separate_vertices(TriangleMesh& mesh);

}  // namespace pencilscan
