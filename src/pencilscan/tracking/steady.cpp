#include "pencilscan/tracking/steady.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "pencilscan/core/chunks.h"
#include "pencilscan/geometry/ray_scene.h"

namespace pencilscan {
namespace {

/// Share of the variance of a vertex's move that the mean over those around it keeps: their windows
/// overlap.
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

/// How far each vertex has come; those between the first ones as far as the farther of their ends.
std::vector<double> spread_travel(const TriangleMesh& mesh, std::span<const float> traveled) {
  std::vector<double> far(mesh.vertices.size(), 0.0);
  std::copy(traveled.begin(), traveled.end(), far.begin());
  for (const auto& face : mesh.faces) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto a = static_cast<std::size_t>(face[k]);
      const auto b = static_cast<std::size_t>(face[(k + 1) % 3]);
      if (a >= traveled.size() && b < traveled.size())
        far[a] = std::max(far[a], static_cast<double>(traveled[b]));
    }
  }
  return far;
}

Earlier earlier_at(const RayScene& scene, const TrackedSurface& before, const Vec3& x,
                   const Vec3& normal, double sigma) {
  constexpr double kFarthest = 6;  // deviations
  Earlier result;
  const double reach = kFarthest * sigma;
  const auto hit = scene.first_hit({x + reach * normal, -normal}, 2 * reach);
  if (!hit || face_normal(scene.mesh(), hit->face).dot(normal) < 0.5) return result;
  double variance = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto v = static_cast<std::size_t>(before.mesh.faces[hit->face][k]);
    if (!(before.variance[v] > 0)) return result;
    variance +=
        hit->barycentric[static_cast<Eigen::Index>(k)] * static_cast<double>(before.variance[v]);
  }
  result.gap = reach - hit->distance;
  result.variance = variance;
  return result;
}

}  // namespace

std::vector<float> first_variance(const TriangleMesh& mesh) {
  std::vector<float> variance(mesh.vertices.size(), 0.F);
  for (std::size_t v = 0; v < variance.size(); ++v) {
    if (mesh.confidence[v] > 0) variance[v] = mesh.sigma[v] * mesh.sigma[v];
  }
  return variance;
}

std::vector<float> steady_surface(const TrackedSurface& before, std::span<const float> traveled,
                                  TriangleMesh& mesh) {
  const std::vector<Vec3> normals = vertex_normals(mesh);
  std::vector<float> variance = first_variance(mesh);
  const std::size_t count = variance.size();
  std::vector<Earlier> earlier(count);
  const RayScene scene(before.mesh);
  parallel_chunks(count, [&](std::size_t v) {
    if (!(variance[v] > 0) || !(normals[v].squaredNorm() > 0.5)) return;
    earlier[v] =
        earlier_at(scene, before, mesh.vertices[v], normals[v], static_cast<double>(mesh.sigma[v]));
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
  const std::vector<double> far = spread_travel(mesh, traveled);
  constexpr double kLeastGain = 1.0 / (kMemoryMoments + 1);
  parallel_chunks(count, [&](std::size_t v) {
    if (!(earlier[v].variance > 0)) return;
    const auto now = static_cast<double>(variance[v]);
    const double noise = kSharedNoise * (now + earlier[v].variance);
    const double motion = std::max(together[v] * together[v] - noise, far[v] * far[v]);
    const double predicted = earlier[v].variance + motion;
    const double gain = std::max(kLeastGain, predicted / (predicted + now));
    mesh.vertices[v] += (1 - gain) * earlier[v].gap * normals[v];
    variance[v] = static_cast<float>(gain * now);
  });
  return variance;
}

}  // namespace pencilscan
