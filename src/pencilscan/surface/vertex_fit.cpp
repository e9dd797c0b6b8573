#include "pencilscan/surface/vertex_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <optional>
#include <unordered_map>
#include <vector>

#include "pencilscan/core/parallel.h"
#include "pencilscan/surface/point_grid.h"

namespace pencilscan {
namespace {

using Vec6 = Eigen::Matrix<double, 6, 1>;

/// Height of the samples' quadric over x along n; nothing where too few define it.
std::optional<double> local_height(std::span<const SurfaceSample> samples, const PointGrid& grid,
                                   const Vec3& x, const Vec3& n, double radius) {
  const Vec3 e1 = n.unitOrthogonal();
  const Vec3 e2 = n.cross(e1);
  Eigen::Matrix<double, 6, 6> A = Eigen::Matrix<double, 6, 6>::Zero();
  Vec6 b = Vec6::Zero();
  int count = 0;
  Vec3 pull = Vec3::Zero();
  double pull_length = 0;
  grid.for_each_within(x, radius, [&](std::size_t i, double d2) {
    const SurfaceSample& s = samples[i];
    if (s.normal.dot(n) < 0.5) return;
    const Vec3 d = (s.position - x) / radius;
    const double h = d.dot(n);
    if (std::abs(h) > 0.5) return;
    const double sigma = s.sigma * std::max(std::abs(s.to_camera.dot(n)), 0.2) / radius;
    const double w = std::exp(-2 * d2 / (radius * radius)) / (1e-5 + sigma * sigma);
    const double u = d.dot(e1);
    const double v = d.dot(e2);
    const Vec6 row{1, u, v, u * u, u * v, v * v};
    A.selfadjointView<Eigen::Lower>().rankUpdate(row, w);
    b += w * h * row;
    pull += d;
    pull_length += d.norm();
    ++count;
  });
  constexpr int kLeast = 8;
  constexpr double kOneSided = 0.55;  // samples that fill a half plane: 2 / pi
  if (count < kLeast || pull.norm() > kOneSided * pull_length) return std::nullopt;
  const double total = A(0, 0);
  for (int k = 1; k < 6; ++k) A(k, k) += (k < 3 ? 1e-6 : 3e-3) * total;
  const Vec6 c = A.selfadjointView<Eigen::Lower>().ldlt().solve(b);
  if (!c.allFinite()) return std::nullopt;
  return std::clamp(c[0], -0.25, 0.25) * radius;
}

}  // namespace

TriangleMesh subdivided(const TriangleMesh& mesh) {
  TriangleMesh fine = mesh;
  fine.faces.clear();
  fine.faces.reserve(4 * mesh.faces.size());
  std::unordered_map<std::uint64_t, int> middles;
  middles.reserve(2 * mesh.faces.size());
  const auto middle = [&](int a, int b) {
    const auto low = static_cast<std::uint64_t>(std::min(a, b));
    const auto high = static_cast<std::uint64_t>(std::max(a, b));
    const auto [it, is_new] =
        middles.try_emplace(low << 32 | high, static_cast<int>(fine.vertices.size()));
    if (is_new) {
      const auto i = static_cast<std::size_t>(a);
      const auto j = static_cast<std::size_t>(b);
      fine.vertices.push_back(0.5 * (mesh.vertices[i] + mesh.vertices[j]));
      if (!mesh.sigma.empty()) fine.sigma.push_back(0.5F * (mesh.sigma[i] + mesh.sigma[j]));
      // Between a measured and an invented vertex nothing was measured.
      if (!mesh.confidence.empty()) {
        const bool both = mesh.confidence[i] > 0 && mesh.confidence[j] > 0;
        fine.confidence.push_back(both ? 0.5F * (mesh.confidence[i] + mesh.confidence[j]) : 0.F);
      }
    }
    return it->second;
  };
  for (const auto& face : mesh.faces) {
    const int a = middle(face[0], face[1]);
    const int b = middle(face[1], face[2]);
    const int c = middle(face[2], face[0]);
    fine.faces.push_back({face[0], a, c});
    fine.faces.push_back({a, face[1], b});
    fine.faces.push_back({c, b, face[2]});
    fine.faces.push_back({a, b, c});
  }
  return fine;
}

void fit_vertices(std::span<const SurfaceSample> samples, double radius, TriangleMesh& mesh) {
  std::vector<Vec3> positions;
  positions.reserve(samples.size());
  for (const SurfaceSample& s : samples) positions.push_back(s.position);
  const PointGrid grid(positions, radius);
  const std::vector<Vec3> normals = vertex_normals(mesh);
  std::vector<Vec3> moved = mesh.vertices;
  constexpr std::size_t kChunk = 512;
  parallel_for((moved.size() + kChunk - 1) / kChunk, [&](std::size_t chunk) {
    for (std::size_t v = chunk * kChunk; v < std::min(moved.size(), (chunk + 1) * kChunk); ++v) {
      if (!(normals[v].squaredNorm() > 0.5)) continue;
      const auto height = local_height(samples, grid, mesh.vertices[v], normals[v], radius);
      if (height) moved[v] += *height * normals[v];
    }
  });
  mesh.vertices = std::move(moved);
}

}  // namespace pencilscan
