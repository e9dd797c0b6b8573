#pragma once

#include <filesystem>
#include <functional>
#include <span>
#include <string>

#include "pencilscan/geometry/mesh.h"

namespace pencilscan {

/// Appends a polygon as triangles. `corners`: indices of vertices of the mesh. `field()` names the
/// polygon in the InputError of an index that is none, and of a polygon that is too intricate.
void append_polygon(const std::filesystem::path& path, const std::function<std::string()>& field,
                    std::span<const double> corners, TriangleMesh& mesh);

/// Reads OFF text, one vertex and one polygon a line; what stands behind coordinates and corners
/// (normals, colours: NOFF, COFF, STOFF) is passed over. InputError with the line at fault, and of
/// binary files and other dimensions than three.
[[nodiscard]] TriangleMesh read_off_mesh(const std::filesystem::path& path);

}  // namespace pencilscan
