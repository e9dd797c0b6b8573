#pragma once

#include <array>
#include <cstdint>
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

/// Faces of each vertex, in order.
class FacesOf {
 public:
  explicit FacesOf(const TriangleMesh& mesh);
  [[nodiscard]] std::span<const std::uint32_t> operator[](std::size_t vertex) const {
    return std::span(faces_).subspan(begin_[vertex], begin_[vertex + 1] - begin_[vertex]);
  }

 private:
  std::vector<std::uint32_t> begin_;
  std::vector<std::uint32_t> faces_;
};

/// The marked vertices (each once) and then those within `edges` edges of them, on paths of
/// vertices that may join.
[[nodiscard]] std::vector<std::size_t> around(
    const TriangleMesh& mesh, const FacesOf& faces, std::vector<std::size_t> marked, int edges,
    const std::function<bool(std::size_t)>& may_join = {});

/// The vertex that follows v around a face of v.
[[nodiscard]] inline std::size_t next_around(const std::array<int, 3>& face, std::size_t v) {
  const std::size_t next = static_cast<std::size_t>(face[0]) == v   ? 1
                           : static_cast<std::size_t>(face[1]) == v ? 2
                                                                    : 0;
  return static_cast<std::size_t>(face[next]);
}

/// The mesh with a fan over every loop of boundary edges, from a new vertex at the loop's mean.
/// Only for meshes without vertex properties.
[[nodiscard]] TriangleMesh with_caps(TriangleMesh mesh);

}  // namespace pencilscan
