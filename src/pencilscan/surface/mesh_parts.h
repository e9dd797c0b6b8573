#pragma once

#include <array>
#include <functional>
#include <span>
#include <vector>

#include "pencilscan/geometry/mesh.h"

namespace pencilscan {

/// Connected component of every face (faces that share a vertex), numbered by first face.
[[nodiscard]] std::vector<int> face_components(const TriangleMesh& mesh);

/// The faces whose keep flag is set, with the vertices they use in the same order, properties too.
[[nodiscard]] TriangleMesh submesh(const TriangleMesh& mesh, std::span<const char> keep_face);

/// Area of one face, mm^2.
[[nodiscard]] double face_area(const TriangleMesh& mesh, std::size_t face);

/// Every face cut into four at the middles of its edges; properties are averaged. The vertices that
/// were there come first. `middles` takes, for each one added, the ends of its edge.
[[nodiscard]] TriangleMesh subdivided(const TriangleMesh& mesh,
                                      std::vector<std::array<int, 2>>* middles = nullptr);

/// The marked vertices and those within `edges` edges of them, on paths of vertices that may join
/// (all, where the function is empty).
[[nodiscard]] std::vector<char> grown(const TriangleMesh& mesh, std::vector<char> marked, int edges,
                                      const std::function<bool(std::size_t)>& may_join = {});

/// The mesh with a fan over every loop of boundary edges, from a new vertex at the loop's mean.
/// Only for meshes without vertex properties.
[[nodiscard]] TriangleMesh with_caps(TriangleMesh mesh);

}  // namespace pencilscan
