#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pencilscan/geometry/mesh.h"

namespace pencilscan {

/// Side of a face: from its vertex `corner` to the next one.
struct FaceSide {
  int low, high;  ///< vertices, low < high
  int face;
  std::int8_t corner;
  bool rises;  ///< from low to high
};

/// The sides of all faces, ordered by (low, high, face): those of one edge follow each other.
[[nodiscard]] std::vector<FaceSide> sides_by_edge(const TriangleMesh& mesh);

/// visit(span of the edge's sides) for every edge.
template <class Visit>
void for_each_edge(std::span<const FaceSide> sides, Visit visit) {
  for (std::size_t i = 0; i < sides.size();) {
    std::size_t end = i;
    while (end < sides.size() && sides[end].low == sides[i].low && sides[end].high == sides[i].high)
      ++end;
    visit(sides.subspan(i, end - i));
    i = end;
  }
}

}  // namespace pencilscan
