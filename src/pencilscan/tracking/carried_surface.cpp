#include "pencilscan/tracking/carried_surface.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "pencilscan/core/chunks.h"
#include "pencilscan/depth/consistency.h"
#include "pencilscan/geometry/ray_scene.h"
#include "pencilscan/surface/attributes.h"
#include "pencilscan/surface/local_fit.h"
#include "pencilscan/surface/node_samples.h"
#include "pencilscan/surface/untangle.h"
#include "pencilscan/tracking/registration.h"

namespace pencilscan {
namespace {

/// Registration leaves gaps of its smallest parts' bending; nodes farther off are another surface.
constexpr double kFarthestNode = 8;  // footprints

/// Of a map's nodes: 1 measured, 2 measured and off the surface by more than a node's spacing.
std::vector<char> explained_nodes(const Rig& rig, const RayScene& scene, const DepthMap& map) {
  const Camera& camera = rig.cameras[static_cast<std::size_t>(map.camera)];
  const Vec3 eye = camera.center();
  std::vector<char> state(map.nodes.size(), 0);
  parallel_chunks(map.nodes.size(), [&](std::size_t i) {
    if (!map.nodes[i].measured()) return;
    const Vec3 x = node_point(rig, map, i);
    const double distance = (x - eye).norm();
    const Ray ray{eye, (x - eye) / distance};
    const double spacing = map.stride / static_cast<double>(map.nodes[i].w) / camera.focal_px();
    const auto hit = scene.first_hit(ray);
    // Across the surface: a slanted one is met far from the node with little between them.
    const double cosine = std::abs(node_normal(rig, map, i).dot(ray.direction));
    const bool is_on = hit && std::abs(hit->distance - distance) * cosine < spacing;
    state[i] = is_on ? 1 : 2;
  });
  return state;
}

/// Nodes off the surface with at least half of the measured nodes around them.
std::size_t solid(const DepthMap& map, const std::vector<char>& state) {
  std::size_t count = 0;
  for (int row = 1; row + 1 < map.rows; ++row) {
    for (int column = 1; column + 1 < map.columns; ++column) {
      if (state[map.index(row, column)] != 2) continue;
      int off = 0;
      int measured = 0;
      for (int dv = -1; dv <= 1; ++dv) {
        for (int du = -1; du <= 1; ++du) {
          const char neighbor = state[map.index(row + dv, column + du)];
          off += neighbor == 2 ? 1 : 0;
          measured += neighbor != 0 ? 1 : 0;
        }
      }
      count += measured >= 4 && 2 * off > measured ? 1U : 0U;
    }
  }
  return count;
}

/// Area over that of the equilateral triangle of the same edges' squares: 1 to 0.
double roundness(const TriangleMesh& mesh, const std::array<int, 3>& face) {
  const Vec3& a = mesh.vertices[static_cast<std::size_t>(face[0])];
  const Vec3& b = mesh.vertices[static_cast<std::size_t>(face[1])];
  const Vec3& c = mesh.vertices[static_cast<std::size_t>(face[2])];
  const double squares = (b - a).squaredNorm() + (c - b).squaredNorm() + (a - c).squaredNorm();
  return squares > 0 ? 2 * std::sqrt(3.0) * (b - a).cross(c - a).norm() / squares : 0;
}

/// Vertices move along the surface towards the mean of their neighbours, so that triangles keep
/// their shape over many moments.
void relax(TriangleMesh& mesh) {
  constexpr double kShare = 0.3;
  std::vector<Vec3> sum(mesh.vertices.size(), Vec3::Zero());
  std::vector<double> count(mesh.vertices.size(), 0.0);
  for (const auto& face : mesh.faces) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto a = static_cast<std::size_t>(face[k]);
      sum[a] += mesh.vertices[static_cast<std::size_t>(face[(k + 1) % 3])];
      ++count[a];
    }
  }
  const std::vector<Vec3> normals = vertex_normals(mesh);
  for (std::size_t v = 0; v < sum.size(); ++v) {
    if (count[v] == 0) continue;
    const Vec3 pull = sum[v] / count[v] - mesh.vertices[v];
    mesh.vertices[v] += kShare * (pull - normals[v].dot(pull) * normals[v]);
  }
}

/// True where a carried surface is as good as one that was made from nothing.
bool is_as_good(const SurfaceFit& carried, const SurfaceFit& made) {
  // Windows overlap, so that what is off is off by patches of so many nodes; the number of patches
  // scatters by its root. A new part is more than three of it.
  constexpr double kScatter = 3;
  constexpr double kPatch = 9;
  constexpr double kShare = 0.02;  // of the surface: what turning brings to light and hides
  const double most = made.unexplained + kScatter * std::sqrt(kPatch * (made.unexplained + kPatch));
  return carried.unexplained <= most && carried.invented <= made.invented + kShare &&
         carried.slivers <= made.slivers + kShare;
}

}  // namespace

SurfaceFit surface_fit(const Rig& rig, std::span<const DepthMap> maps, const TriangleMesh& mesh) {
  SurfaceFit fit;
  const RayScene scene(mesh);
  for (const DepthMap& map : maps)
    fit.unexplained += static_cast<double>(solid(map, explained_nodes(rig, scene, map)));
  const auto invented = std::count_if(mesh.confidence.begin(), mesh.confidence.end(),
                                      [](float confidence) { return !(confidence > 0); });
  fit.invented = static_cast<double>(invented) / static_cast<double>(mesh.confidence.size());
  constexpr double kSliver = 0.2;
  const auto slivers = std::count_if(
      mesh.faces.begin(), mesh.faces.end(),
      [&](const std::array<int, 3>& face) { return roundness(mesh, face) < kSliver; });
  fit.slivers = static_cast<double>(slivers) / static_cast<double>(mesh.faces.size());
  return fit;
}

std::optional<CarriedSurface> carry_surface(const Rig& rig, std::span<const DepthMap> maps,
                                            const TrackedSurface& before,
                                            const FusionOptions& options,
                                            std::span<const Silhouette> silhouettes) {
  constexpr std::size_t kLeastSamples = 1000;  // fewer do not tell how a surface moved
  CarriedSurface result;
  SurfaceReport& report = result.surface.report;
  std::vector<SurfaceSample> samples = node_samples(rig, maps, report.spacing_mm);
  if (samples.size() < kLeastSamples) return std::nullopt;
  TriangleMesh& mesh = result.surface.mesh;
  mesh = before.coarse();
  const std::vector<Vec3> then = mesh.vertices;
  Registration registration = register_surface(mesh, samples, report.spacing_mm, before.motion);
  result.motion = registration.motion;
  for (std::size_t v = 0; v < then.size(); ++v)
    result.traveled.push_back(static_cast<float>((registration.vertices[v] - then[v]).norm()));
  mesh.vertices = std::move(registration.vertices);
  relax(mesh);
  FollowOptions wide = options.follow;
  wide.farthest = kFarthestNode;
  follow_nodes(rig, maps, wide, mesh);
  fit_local_surfaces(samples, options.fit_spacings * report.spacing_mm);
  attribute_vertices(samples, options.reach_spacings, report.spacing_mm, mesh);
  if (!is_as_good(surface_fit(rig, maps, mesh), before.fit)) return std::nullopt;
  std::vector<Vec3> whole = then;  // moved rigidly, it did not cut itself
  for (Vec3& x : whole) x = result.motion * x;
  carve(rig, silhouettes, options.carving, mesh);
  untangle(whole, mesh);
  result.surface.samples = std::move(samples);
  return result;
}

}  // namespace pencilscan
