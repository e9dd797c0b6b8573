#include "pencilscan/surface/supported.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/core/chunks.h"
#include "pencilscan/surface/point_grid.h"

namespace pencilscan {
namespace {

std::vector<Vec3> places_of(std::span<const MeasuredPoint> points) {
  constexpr std::size_t kEvery = 4;  // points follow each other by a pixel
  std::vector<Vec3> places;
  for (std::size_t i = 0; i < points.size(); i += kEvery) places.push_back(position_of(points[i]));
  return places;
}

/// Squared distance to the nearest place within `radius`; `none` where there is none below that.
double nearest2(const PointGrid& grid, const Vec3& x, double radius, double none) {
  double nearest = none;
  grid.for_each_within(x, radius, [&](std::size_t, double d2) { nearest = std::min(nearest, d2); });
  return nearest;
}

}  // namespace

std::vector<char> unsupported_vertices(const TriangleMesh& mesh,
                                       std::span<const MeasuredPoint> points,
                                       std::span<const MeasuredPoint> denied, double reach) {
  const std::vector<Vec3> places = places_of(points);
  const std::vector<Vec3> denied_places = places_of(denied);
  // Nearly every vertex has a point much nearer, which takes few looks to find.
  const PointGrid grid(places, 0.25 * reach);
  const PointGrid denied_grid(denied_places, 0.25 * reach);
  std::vector<char> unsupported(mesh.vertices.size(), 0);
  parallel_chunks(mesh.vertices.size(), [&](std::size_t v) {
    const Vec3& x = mesh.vertices[v];
    if (!(mesh.confidence[v] > 0)) return;
    const double far = reach * reach;
    double nearest = nearest2(grid, x, 0.25 * reach, far);
    if (nearest == far) nearest = nearest2(grid, x, reach, far);
    if (nearest == far || nearest2(denied_grid, x, std::sqrt(nearest), nearest) < nearest)
      unsupported[v] = 1;
  });
  return unsupported;
}

}  // namespace pencilscan
