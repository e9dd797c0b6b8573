#pragma once

#include "pencilscan/geometry/mesh.h"

namespace pencilscan {

/// The mesh without the vertices that no face has: they are no surface, and yet they count for its
/// extent. Programs leave them behind, wherever they were, when faces are deleted.
[[nodiscard]] TriangleMesh without_unused_vertices(TriangleMesh mesh);

}  // namespace pencilscan
