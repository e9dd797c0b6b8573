#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "pencilscan/geometry/ray_scene.h"
#include "pencilscan/io/curve_file.h"
#include "pencilscan/io/point_file.h"
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

/// Every `stride`-th point. distance_mm, albedo: per point, or empty.
[[nodiscard]] Block points_block(std::span<const MeasuredPoint> points,
                                 std::span<const float> distance_mm, std::span<const float> albedo,
                                 std::size_t stride = 1);

/// The mesh with at most about `max_faces` faces: edges collapse where that changes the shape least
/// (quadrics of Garland and Heckbert, 1997, by meshoptimizer); vertices that remain keep their
/// place and properties.
[[nodiscard]] TriangleMesh decimated(const TriangleMesh& mesh, std::size_t max_faces);

/// distance_mm, albedo: per vertex, or empty.
[[nodiscard]] Block mesh_block(const TriangleMesh& mesh, std::span<const float> distance_mm,
                               std::span<const float> albedo);
[[nodiscard]] std::vector<float> vertex_distances(const TriangleMesh& mesh, const RayScene& truth);

/// Points of curves in order, camera by camera, with their local IDs, and the crossings.
[[nodiscard]] Block curves_block(const Rig& rig, const CurveFile& curves);

}  // namespace pencilscan
