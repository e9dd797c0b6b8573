#include "pencilscan/surface/supported.h"

#include "pencilscan/core/chunks.h"
#include "pencilscan/surface/point_grid.h"

namespace pencilscan {

std::vector<char> unsupported_vertices(const TriangleMesh& mesh,
                                       std::span<const MeasuredPoint> points, double reach) {
  constexpr std::size_t kEvery = 4;  // points follow each other by a pixel
  std::vector<Vec3> places;
  for (std::size_t i = 0; i < points.size(); i += kEvery) places.push_back(position_of(points[i]));
  // Nearly every vertex has a point much nearer, which takes few looks to find.
  const PointGrid grid(places, 0.25 * reach);
  const auto has_within = [&](const Vec3& x, double radius) {
    bool found = false;
    grid.for_each_within(x, radius, [&](std::size_t, double) { found = true; });
    return found;
  };
  std::vector<char> unsupported(mesh.vertices.size(), 0);
  parallel_chunks(mesh.vertices.size(), [&](std::size_t v) {
    const Vec3& x = mesh.vertices[v];
    if (!(mesh.confidence[v] > 0) || has_within(x, 0.25 * reach) || has_within(x, reach)) return;
    unsupported[v] = 1;
  });
  return unsupported;
}

}  // namespace pencilscan
