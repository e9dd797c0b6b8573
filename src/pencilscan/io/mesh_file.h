#pragma once

#include <filesystem>

#include "pencilscan/geometry/mesh.h"

namespace pencilscan {

/// Reads PLY (with sigma, confidence, hole and 8-bit sRGB colours where present), OBJ, STL (both by
/// Assimp) or OFF (vertices of equal position joined in these three, and in a PLY whose faces share
/// none); polygons become triangles,
/// also those that are not convex. InputError when missing, unreadable, cut off, without faces or
/// with non-finite vertices.
[[nodiscard]] TriangleMesh read_mesh(const std::filesystem::path& path);

/// Binary little-endian PLY: float x y z, optional float sigma, confidence, uchar hole; triangles.
/// `unit_known`: as the rig has it; else the file says "unit unknown". Whole or not at all.
void write_mesh(const std::filesystem::path& path, const TriangleMesh& mesh,
                bool unit_known = true);

/// Removes the mesh of an earlier result, where there is one, so that it does not stay beside new
/// points. StageError when it cannot be removed.
void remove_older_mesh(const std::filesystem::path& path);

/// Writes for other programs, by the ending: .obj (text, mm), .stl (binary, mm) or .glb (glTF 2.0
/// binary: metres, y up, as glTF wants it), positions, triangles and colours. Without `unit_known`
/// the numbers are those of the mesh in all of them, and the file says that their unit is unknown.
/// Whole or not at all. InputError for another ending.
void export_mesh(const std::filesystem::path& path, const TriangleMesh& mesh,
                 bool unit_known = true);

}  // namespace pencilscan
