#include "pencilscan/surface/closing.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/surface/attributes.h"
#include "pencilscan/surface/mesh_parts.h"
#include "pencilscan/surface/poisson.h"

namespace pencilscan {
namespace {

/// Depth at which the octree's cells have the wished size.
int octree_depth(std::span<const SurfaceSample> samples, const ClosingOptions& options,
                 double scale) {
  Vec3 low = samples[0].position;
  Vec3 high = low;
  for (const SurfaceSample& s : samples) {
    low = low.cwiseMin(s.position);
    high = high.cwiseMax(s.position);
  }
  const double extent = scale * (high - low).maxCoeff();
  const double cells = extent / (options.cell_mm);
  return std::clamp(static_cast<int>(std::ceil(std::log2(std::max(cells, 1.0)) - 0.25)), 5,
                    options.max_depth);
}

/// Keeps the component with the largest measured area and those with a fair share of it.
TriangleMesh without_floaters(const TriangleMesh& mesh, double min_share, std::size_t& removed) {
  const std::vector<int> component = face_components(mesh);
  const std::vector<char> measured = measured_faces(mesh);
  std::vector<double> area;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const auto c = static_cast<std::size_t>(component[f]);
    if (c >= area.size()) area.resize(c + 1, 0.0);
    if (measured[f]) area[c] += face_area(mesh, f);
  }
  if (area.size() <= 1) return mesh;
  const auto largest = std::max_element(area.begin(), area.end());
  std::vector<char> keep_component(area.size());
  for (std::size_t c = 0; c < area.size(); ++c) {
    keep_component[c] = c == static_cast<std::size_t>(largest - area.begin()) ||
                        (area[c] > 0 && area[c] >= min_share * *largest);
    removed += keep_component[c] ? 0 : 1;
  }
  std::vector<char> keep(mesh.faces.size());
  for (std::size_t f = 0; f < keep.size(); ++f) {
    keep[f] = keep_component[static_cast<std::size_t>(component[f])];
  }
  return submesh(mesh, keep);
}

}  // namespace

ClosedSurface closed_surface(std::span<const SurfaceSample> samples,
                             const ClosingOptions& options) {
  constexpr int kProbeDepth = 6;  // half a second, against several at the full depth
  // The smallest cube that the surface does not leave. A coarse surface leaves it where a fine one
  // does. What few cameras saw may leave any cube: it is cut by the smallest one and capped there.
  constexpr double kSmallest = 1.5;
  double scale = kSmallest;
  for (const double wider : {kSmallest, 2.0, 3.0}) {
    if (count_edges(poisson_surface(samples, kProbeDepth, wider)).boundary > 0) continue;
    scale = wider;
    break;
  }
  ClosedSurface result;
  result.scale = scale;
  result.depth = octree_depth(samples, options, scale);
  result.mesh = with_caps(poisson_surface(samples, result.depth, scale));
  attribute_vertices(samples, options.reach_spacings, options.spacing_mm, result.mesh);
  result.mesh =
      without_floaters(result.mesh, options.min_component_share, result.components_removed);
  result.edges = count_edges(result.mesh);
  return result;
}

}  // namespace pencilscan
