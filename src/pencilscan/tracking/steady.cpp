#include "pencilscan/tracking/steady.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <utility>

#include "pencilscan/core/chunks.h"
#include "pencilscan/geometry/ray_scene.h"
#include "pencilscan/surface/sample.h"
#include "pencilscan/tracking/registration.h"

namespace pencilscan {
namespace {

/// Share of the variance of a vertex's move that the mean over those around it keeps: their windows
/// overlap. The parts that registration moves are wider than what is taken here as around it.
constexpr double kSharedNoise = 0.1;

/// The surface of the moment before, along a vertex's normal.
struct Earlier {
  double gap = 0;       ///< from the vertex to it
  double variance = 0;  ///< of it; 0: nothing measured is near
};

/// Weighted means over the vertices around each, so many edges far and weighing less with each.
std::vector<double> spread(const TriangleMesh& mesh, std::vector<double> values,
                           std::vector<double> weights) {
  constexpr int kEdges = 8;  // of the fine mesh: two spacings of nodes, as wide as their windows
  std::vector<double> value_sum(values.size());
  std::vector<double> weight_sum(values.size());
  for (std::size_t v = 0; v < values.size(); ++v) values[v] *= weights[v];
  for (int edge = 0; edge < kEdges; ++edge) {
    value_sum = values;
    weight_sum = weights;
    for (const auto& face : mesh.faces) {
      for (std::size_t k = 0; k < 3; ++k) {
        const auto a = static_cast<std::size_t>(face[k]);
        const auto b = static_cast<std::size_t>(face[(k + 1) % 3]);
        // Each edge of a closed mesh is met once from either end.
        value_sum[a] += values[b];
        weight_sum[a] += weights[b];
      }
    }
    // A seventh: a vertex and its six neighbours, so that sums stay as large as they were.
    for (std::size_t v = 0; v < values.size(); ++v) {
      values[v] = value_sum[v] / 7;
      weights[v] = weight_sum[v] / 7;
    }
  }
  for (std::size_t v = 0; v < values.size(); ++v)
    values[v] = weights[v] > 0 ? values[v] / weights[v] : 0;
  return values;
}

/// The middles of measured coarse edges, as registration takes points. They lie on chords of the
/// surface, as the mesh does that is registered: over the three of a triangle a quadric is as far
/// off in the mean as over the triangle, so that curvature does not seem to be motion.
std::vector<SurfaceSample> edge_middles(const TriangleMesh& mesh, std::span<const Vec3> normals,
                                        std::span<const std::array<int, 3>> coarse_faces) {
  std::vector<SurfaceSample> samples;
  for (const auto& face : coarse_faces) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto a = static_cast<std::size_t>(face[k]);
      const auto b = static_cast<std::size_t>(face[(k + 1) % 3]);
      // Each edge of a closed mesh is met once from either end.
      if (a > b || !(mesh.confidence[a] > 0) || !(mesh.confidence[b] > 0)) continue;
      SurfaceSample& sample = samples.emplace_back();
      sample.position = 0.5 * (mesh.vertices[a] + mesh.vertices[b]);
      sample.normal = (normals[a] + normals[b]).normalized();
    }
  }
  return samples;
}

/// How far the surface at a place has come since `then`, whose vertices moved to those of `now`;
/// nothing where it is not within `reach`.
std::optional<double> travel_at(const TriangleMesh& then, const RayScene& now, const Vec3& place,
                                double reach) {
  const auto closest = now.closest_point(place, reach);
  if (!closest) return std::nullopt;
  double farthest = 0;
  for (const int corner : then.faces[closest->face]) {
    const auto v = static_cast<std::size_t>(corner);
    farthest = std::max(farthest, (now.mesh().vertices[v] - then.vertices[v]).norm());
  }
  return farthest;
}

/// The surface of the moment before, whose triangles are others than those of this moment.
class EarlierSurface {
 public:
  explicit EarlierSurface(const TrackedSurface& before)
      : before_(before), scene_(before.mesh), normals_(vertex_normals(before.mesh)) {}

  /// Along the normal of a vertex at x.
  [[nodiscard]] Earlier at(const Vec3& x, const Vec3& normal, double sigma) const {
    constexpr double kFarthest = 6;  // deviations
    Earlier result;
    const double reach = kFarthest * sigma;
    const auto hit = scene_.first_hit({x + reach * normal, -normal}, 2 * reach);
    if (!hit || face_normal(before_.mesh, hit->face).dot(normal) < 0.5) return result;
    const Vec3 on_face = x + (reach - hit->distance) * normal;
    Vec3 to_tangents = Vec3::Zero();
    double variance = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto v = static_cast<std::size_t>(before_.mesh.faces[hit->face][k]);
      if (!(before_.variance[v] > 0)) return result;
      const double share = hit->barycentric[static_cast<Eigen::Index>(k)];
      variance += share * static_cast<double>(before_.variance[v]);
      to_tangents += share * normals_[v].dot(before_.mesh.vertices[v] - on_face) * normals_[v];
    }
    // A face is a chord: over it, a quadric lies halfway to the mean of its corners' tangent planes
    // (as in T. Boubekeur, M. Alexa, Phong tessellation, SIGGRAPH Asia 2008).
    result.gap = reach - hit->distance + 0.5 * normal.dot(to_tangents);
    result.variance = variance;
    return result;
  }

 private:
  const TrackedSurface& before_;
  RayScene scene_;
  std::vector<Vec3> normals_;
};

}  // namespace

std::vector<float> first_variance(const TriangleMesh& mesh) {
  std::vector<float> variance(mesh.vertices.size(), 0.F);
  for (std::size_t v = 0; v < variance.size(); ++v) {
    if (mesh.confidence[v] > 0) variance[v] = mesh.sigma[v] * mesh.sigma[v];
  }
  return variance;
}

Steadied steady_surface(const TrackedSurface& before, double spacing,
                        std::span<const std::array<int, 3>> coarse_faces, TriangleMesh& mesh) {
  const std::vector<Vec3> normals = vertex_normals(mesh);
  const TriangleMesh then = before.coarse();
  Registration registration =
      register_surface(then, edge_middles(mesh, normals, coarse_faces), spacing, before.motion);
  TriangleMesh moved = then;
  moved.vertices = std::move(registration.vertices);
  const RayScene registered(moved);
  Steadied result{first_variance(mesh), registration.motion};
  std::vector<float>& variance = result.variance;
  const std::size_t count = variance.size();
  std::vector<Earlier> earlier(count);
  const EarlierSurface surface(before);
  parallel_chunks(count, [&](std::size_t v) {
    if (!(variance[v] > 0) || !(normals[v].squaredNorm() > 0.5)) return;
    earlier[v] = surface.at(mesh.vertices[v], normals[v], static_cast<double>(mesh.sigma[v]));
  });
  std::vector<double> gaps(count, 0.0);
  std::vector<double> weights(count, 0.0);
  for (std::size_t v = 0; v < count; ++v) {
    if (!(variance[v] > 0)) continue;
    // Where the moment before has nothing within reach, everything moved.
    weights[v] = 1;
    gaps[v] = earlier[v].variance > 0 ? earlier[v].gap : 6 * static_cast<double>(mesh.sigma[v]);
  }
  const std::vector<double> together = spread(mesh, gaps, weights);
  constexpr double kLeastGain = 1.0 / (kMemoryMoments + 1);
  // A mean that takes a hundredth off the variance takes half of one off the deviation.
  constexpr double kMostGain = 0.99;
  parallel_chunks(count, [&](std::size_t v) {
    if (!(earlier[v].variance > 0)) return;
    const auto now = static_cast<double>(variance[v]);
    const double noise = kSharedNoise * (now + earlier[v].variance);
    const auto gain_after = [&](double way) {
      const double predicted = earlier[v].variance + std::max(0.0, way * way - noise);
      return std::max(kLeastGain, predicted / (predicted + now));
    };
    double way = std::abs(together[v]);
    if (gain_after(way) > kMostGain) return;
    const auto travel = travel_at(then, registered, mesh.vertices[v], spacing);
    if (!travel) return;
    way = std::max(way, *travel);
    const double gain = gain_after(way);
    if (gain > kMostGain) return;
    mesh.vertices[v] += (1 - gain) * earlier[v].gap * normals[v];
    variance[v] = static_cast<float>(gain * now);
  });
  return result;
}

}  // namespace pencilscan
