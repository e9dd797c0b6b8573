#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "pencilscan/geometry/types.h"

namespace pencilscan {

/// Triangle mesh as a value. Invariant kept by its makers: indices lie in [0, vertices.size()).
/// Optional per-vertex properties are empty or as long as `vertices`.
struct TriangleMesh {
  std::vector<Vec3> vertices;               ///< mm
  std::vector<std::array<int, 3>> faces;    ///< counter-clockwise seen from outside
  std::vector<float> sigma;                 ///< mm along the normal
  std::vector<float> confidence;            ///< 0..1
  std::vector<std::array<float, 3>> color;  ///< albedo, linear red, green, blue in [0, 1]
  std::vector<std::uint8_t> hole;           ///< why nobody measured it (HoleReason of depth)
};

/// Along the axes, mm.
struct BoundingBox {
  Vec3 low = Vec3::Zero();
  Vec3 high = Vec3::Zero();
};

/// Of all vertices; of none, both corners are the origin.
[[nodiscard]] BoundingBox bounding_box(const TriangleMesh& mesh);
[[nodiscard]] double surface_area(const TriangleMesh& mesh);   ///< mm^2
[[nodiscard]] double signed_volume(const TriangleMesh& mesh);  ///< mm^3, > 0 for outward faces
/// Area-weighted unit normals per vertex (zero for a vertex without area).
[[nodiscard]] std::vector<Vec3> vertex_normals(const TriangleMesh& mesh);
[[nodiscard]] Vec3 face_normal(const TriangleMesh& mesh, std::size_t face);  ///< unit, or zero
/// All its vertices have confidence. Of a mesh with confidences.
[[nodiscard]] bool is_measured(const TriangleMesh& mesh, std::size_t face);
/// How high a smooth surface through the vertices, with the mesh's vertex normals, stands over the
/// faces around each vertex, mm, > 0 where it is convex: the mean over the areas of these faces and
/// of their neighbours.
[[nodiscard]] std::vector<double> mean_bows(const TriangleMesh& mesh);
/// Number of undirected edges that have one face (boundary) and more than two (non-manifold).
struct EdgeCounts {
  std::size_t boundary = 0;
  std::size_t non_manifold = 0;
};
[[nodiscard]] EdgeCounts count_edges(const TriangleMesh& mesh);
/// The mesh moved by world_from_mesh.
[[nodiscard]] TriangleMesh transformed(TriangleMesh mesh, const RigidTransform& world_from_mesh);
/// Closed analytic shapes, outward faces.
[[nodiscard]] TriangleMesh make_box(const Vec3& size_mm, const Vec3& center = Vec3::Zero());
[[nodiscard]] TriangleMesh make_sphere(double radius_mm, int rings = 32,
                                       const Vec3& center = Vec3::Zero());

}  // namespace pencilscan
