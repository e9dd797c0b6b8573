#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/geometry/ray_scene.h"
#include "pencilscan/io/curve_file.h"
#include "pencilscan/labeling/measured_point.h"
#include "pencilscan/page/block.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// How far points are from the truth; NaN where a ray misses it.
struct PointErrors {
  std::vector<float> distance_mm;   ///< to the surface
  std::vector<float> along_ray_mm;  ///< along the camera ray, >= 0
};
[[nodiscard]] PointErrors point_errors(const Rig& rig, std::span<const MeasuredPoint> points,
                                       const RayScene& truth);

/// Every `stride`-th point. distance_mm: per point, or empty.
[[nodiscard]] Block points_block(std::span<const MeasuredPoint> points,
                                 std::span<const float> distance_mm, std::size_t stride = 1);

/// The mesh with at most about `max_faces` faces: edges collapse where that changes the shape least
/// (quadrics of Garland and Heckbert, 1997, by meshoptimizer); vertices that remain keep their
/// place and properties. Where far fewer faces are wanted than there are, vertices are first
/// clustered on a grid, which is fast and may leave edges of more than two faces.
[[nodiscard]] TriangleMesh decimated(const TriangleMesh& mesh, std::size_t max_faces);

/// How exactly a mesh is stored: for measuring on it, or for playing.
enum class MeshPrecision { kFine, kCoarse };

/// distance_mm: per vertex, or empty. A coarse one has no colours.
[[nodiscard]] Block mesh_block(const TriangleMesh& mesh, std::span<const float> distance_mm,
                               MeshPrecision precision = MeshPrecision::kFine);
/// A mesh that the browser need not unpack, for 25 of them a second: length of the header (uint32),
/// the header (JSON: `arrays`, of each `at` and `count`), then the arrays, little endian, each at a
/// multiple of four bytes: `position` (x y z of each vertex, float32), `index` (uint32), `sigma`
/// (float32), `confidence` and `hole` (bytes). web/src/block.ts reads it.
[[nodiscard]] std::string unpacked_mesh(const TriangleMesh& mesh);
[[nodiscard]] std::vector<float> vertex_distances(const TriangleMesh& mesh, const RayScene& truth);

/// Points of curves in order, camera by camera, with their local IDs, and the crossings.
[[nodiscard]] Block curves_block(const Rig& rig, const CurveFile& curves);

}  // namespace pencilscan
