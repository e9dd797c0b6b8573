#include "pencilscan/surface/closing.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "pencilscan/surface/attributes.h"
#include "pencilscan/surface/inside_field.h"
#include "pencilscan/surface/manifold.h"
#include "pencilscan/surface/marching_cubes.h"
#include "pencilscan/surface/mesh_parts.h"

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

/// The cube within which the surface closes: this many times the samples' own.
constexpr double kRoom = 1.5;

/// Keeps the component with the largest measured area and those with a fair share of it.
TriangleMesh without_floaters(const TriangleMesh& mesh, double min_share) {
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
  }
  std::vector<char> keep(mesh.faces.size());
  for (std::size_t f = 0; f < keep.size(); ++f) {
    keep[f] = keep_component[static_cast<std::size_t>(component[f])];
  }
  return submesh(mesh, keep);
}

}  // namespace

ClosedSurface surface_within_cube(std::span<const SurfaceSample> samples, double cell_mm,
                                  int max_depth, const std::optional<Floor>& floor) {
  const Cube cube = bounding_cube(samples);
  const double side = 2 * kRoom * std::max(cube.half_side, cell_mm);
  int cells = 32;
  ClosedSurface result;
  result.depth = 5;
  for (; result.depth < max_depth && cells * cell_mm < side; ++result.depth) cells *= 2;
  const double cell = std::max(cell_mm, side / cells);
  const Vec3 origin = cube.center - Vec3::Constant(0.5 * cell * cells);
  const InsideField field = inside_field(samples, origin, cell, cells, floor);
  // Caps: where the surface leaves the cells around it, which its growth from level to level
  // prevents.
  result.mesh = with_caps(marching_cubes(field.lattice, field.values, field.origin, field.cell));
  make_manifold(result.mesh);
  return result;
}

ClosedSurface closed_surface(std::span<const SurfaceSample> samples,
                             const ClosingOptions& options) {
  ClosedSurface result =
      surface_within_cube(samples, options.cell_mm, options.max_depth, options.floor);
  attribute_vertices(samples, options.reach_spacings, options.spacing_mm, result.mesh);
  result.mesh = without_floaters(result.mesh, options.min_component_share);
  return result;
}

}  // namespace pencilscan
