#include "pencilscan/surface/closing.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "pencilscan/surface/attributes.h"
#include "pencilscan/surface/manifold.h"
#include "pencilscan/surface/mesh_parts.h"
#include "pencilscan/surface/poisson.h"

namespace pencilscan {
namespace {

struct Cube {
  Vec3 center;
  double half_side;
};

Cube bounding_cube(std::span<const SurfaceSample> samples) {
  Vec3 low = samples[0].position;
  Vec3 high = low;
  for (const SurfaceSample& s : samples) {
    low = low.cwiseMin(s.position);
    high = high.cwiseMax(s.position);
  }
  return {0.5 * (low + high), 0.5 * (high - low).maxCoeff()};
}

/// Every so many samples, that a cell of an octree still has a few: coarse surfaces need no more.
std::vector<SurfaceSample> thinned(std::span<const SurfaceSample> samples, double cell_spacings) {
  constexpr double kPerCell = 4;
  const auto step =
      static_cast<std::size_t>(std::max(1.0, cell_spacings * cell_spacings / kPerCell));
  std::vector<SurfaceSample> few;
  for (std::size_t i = 0; i < samples.size(); i += step) few.push_back(samples[i]);
  return few;
}

/// Side of a cube that the closed surface does not leave, relative to the samples' bounding cube:
/// the smaller, the finer the octree. A coarse surface tells. What few cameras saw may leave any
/// cube: it is cut by the smallest one and capped there.
double cube_scale(std::span<const SurfaceSample> samples, const Cube& cube, double spacing) {
  constexpr int kProbeDepth = 6;
  constexpr double kSmallest = 1.5;
  constexpr double kWide = 2;
  constexpr double kWidest = 3;
  constexpr double kRoom = 1.25;  // a surface moves outwards with the faces of its cube near by
  constexpr double kCells = 1 << kProbeDepth;
  const std::vector<SurfaceSample> few =
      thinned(samples, 2 * kWide * cube.half_side / kCells / spacing);
  const TriangleMesh probe = poisson_surface(few, kProbeDepth, kWide);
  if (count_edges(probe).boundary == 0) {
    double reach = 0;
    for (const Vec3& x : probe.vertices)
      reach = std::max(reach, (x - cube.center).cwiseAbs().maxCoeff());
    return kRoom * reach < kSmallest * cube.half_side ? kSmallest : kWide;
  }
  const bool is_inside = count_edges(poisson_surface(few, kProbeDepth, kWidest)).boundary == 0;
  return is_inside ? kWidest : kSmallest;
}

/// Depth at which the octree's cells have the wished size.
int octree_depth(const Cube& cube, const ClosingOptions& options, double scale) {
  const double cells = 2 * scale * cube.half_side / options.cell_mm;
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
  const Cube cube = bounding_cube(samples);
  ClosedSurface result;
  result.scale = cube_scale(samples, cube, options.spacing_mm);
  result.depth = octree_depth(cube, options, result.scale);
  result.mesh = with_caps(poisson_surface(samples, result.depth, result.scale));
  make_manifold(result.mesh);
  attribute_vertices(samples, options.reach_spacings, options.spacing_mm, result.mesh);
  result.mesh =
      without_floaters(result.mesh, options.min_component_share, result.components_removed);
  return result;
}

}  // namespace pencilscan
