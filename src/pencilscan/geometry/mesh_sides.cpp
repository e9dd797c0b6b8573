#include "pencilscan/geometry/mesh_sides.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

#include "pencilscan/core/chunks.h"

namespace pencilscan {

std::vector<FaceSide> sides_by_edge(const TriangleMesh& mesh) {
  // Counted by the lower vertex, which takes no comparisons; of a vertex there are few sides.
  std::vector<std::size_t> next(mesh.vertices.size() + 1, 0);
  for (const auto& face : mesh.faces) {
    for (std::size_t k = 0; k < 3; ++k)
      ++next[static_cast<std::size_t>(std::min(face[k], face[(k + 1) % 3])) + 1];
  }
  for (std::size_t v = 1; v < next.size(); ++v) next[v] += next[v - 1];
  std::vector<FaceSide> sides(3 * mesh.faces.size());
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const std::array<int, 3>& face = mesh.faces[f];
    for (std::size_t k = 0; k < 3; ++k) {
      const int a = face[k];
      const int b = face[(k + 1) % 3];
      const int low = std::min(a, b);
      sides[next[static_cast<std::size_t>(low)]++] = {low, std::max(a, b), static_cast<int>(f),
                                                      static_cast<std::int8_t>(k), a < b};
    }
  }
  // next[v] is now the end of v's sides.
  parallel_chunks(mesh.vertices.size(), [&](std::size_t v) {
    const std::size_t begin = v == 0 ? 0 : next[v - 1];
    std::sort(sides.begin() + static_cast<std::ptrdiff_t>(begin),
              sides.begin() + static_cast<std::ptrdiff_t>(next[v]),
              [](const FaceSide& a, const FaceSide& b) {
                return std::pair(a.high, a.face) < std::pair(b.high, b.face);
              });
  });
  return sides;
}

}  // namespace pencilscan
