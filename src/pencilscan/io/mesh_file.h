#pragma once

#include <filesystem>

#include "pencilscan/geometry/mesh.h"

namespace pencilscan {

/// Reads PLY, OBJ, STL or OFF (by Assimp; faces triangulated, equal vertices joined for STL).
/// InputError when missing, unreadable, without faces or with non-finite vertices.
[[nodiscard]] TriangleMesh read_mesh(const std::filesystem::path& path);

/// Binary little-endian PLY: float x y z, optional float sigma, confidence; triangles. Whole or not at all.
void write_mesh(const std::filesystem::path& path, const TriangleMesh& mesh);

}  // namespace pencilscan
