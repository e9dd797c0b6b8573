#include "pencilscan/geometry/mesh.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <span>

#include "pencilscan/core/chunks.h"
#include "pencilscan/geometry/mesh_sides.h"

namespace pencilscan {
namespace {

Vec3 doubled_area_vector(const TriangleMesh& mesh, const std::array<int, 3>& face) {
  const Vec3& a = mesh.vertices[static_cast<std::size_t>(face[0])];
  const Vec3& b = mesh.vertices[static_cast<std::size_t>(face[1])];
  const Vec3& c = mesh.vertices[static_cast<std::size_t>(face[2])];
  return (b - a).cross(c - a);
}

}  // namespace

BoundingBox bounding_box(const TriangleMesh& mesh) {
  BoundingBox box;
  if (mesh.vertices.empty()) return box;
  box.low = box.high = mesh.vertices.front();
  for (const Vec3& v : mesh.vertices) {
    box.low = box.low.cwiseMin(v);
    box.high = box.high.cwiseMax(v);
  }
  return box;
}

double surface_area(const TriangleMesh& mesh) {
  double area = 0;
  for (const auto& face : mesh.faces) area += 0.5 * doubled_area_vector(mesh, face).norm();
  return area;
}

double signed_volume(const TriangleMesh& mesh) {
  double volume = 0;
  for (const auto& face : mesh.faces) {
    volume +=
        mesh.vertices[static_cast<std::size_t>(face[0])].dot(doubled_area_vector(mesh, face)) / 6;
  }
  return volume;
}

std::vector<Vec3> vertex_normals(const TriangleMesh& mesh) {
  std::vector<Vec3> normals(mesh.vertices.size(), Vec3::Zero());
  for (const auto& face : mesh.faces) {
    const Vec3 n = doubled_area_vector(mesh, face);
    for (const int v : face) normals[static_cast<std::size_t>(v)] += n;
  }
  parallel_chunks(normals.size(), [&](std::size_t v) { normals[v].stableNormalize(); });
  return normals;
}

Vec3 face_normal(const TriangleMesh& mesh, std::size_t face) {
  return doubled_area_vector(mesh, mesh.faces[face]).stableNormalized();
}

bool is_measured(const TriangleMesh& mesh, std::size_t face) {
  return std::all_of(mesh.faces[face].begin(), mesh.faces[face].end(),
                     [&](int v) { return mesh.confidence[static_cast<std::size_t>(v)] > 0; });
}

std::vector<double> mean_bows(const TriangleMesh& mesh) {
  std::vector<double> areas(mesh.faces.size());
  std::vector<double> bows(mesh.faces.size());
  const auto around_vertices = [&] {
    std::vector<double> sum(mesh.vertices.size(), 0);
    std::vector<double> area(mesh.vertices.size(), 0);
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      for (const int v : mesh.faces[f]) {
        sum[static_cast<std::size_t>(v)] += areas[f] * bows[f];
        area[static_cast<std::size_t>(v)] += areas[f];
      }
    }
    for (std::size_t v = 0; v < sum.size(); ++v) sum[v] = area[v] > 0 ? sum[v] / area[v] : 0;
    return sum;
  };
  // A parabola from a to b turns by its curvature times their distance, and rises over the middle
  // of its chord by an eighth of that times the distance. A quadratic function that is zero at a
  // triangle's corners has the mean of its values at the sides' middles as its mean.
  const std::vector<Vec3> normals = vertex_normals(mesh);
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const auto& face = mesh.faces[f];
    for (std::size_t k = 0; k < 3; ++k) {
      const auto a = static_cast<std::size_t>(face[k]);
      const auto b = static_cast<std::size_t>(face[(k + 1) % 3]);
      bows[f] += (mesh.vertices[b] - mesh.vertices[a]).dot(normals[b] - normals[a]) / 24;
    }
    areas[f] = doubled_area_vector(mesh, face).norm();
  }
  const std::vector<double> near = around_vertices();
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    bows[f] = 0;
    for (const int v : mesh.faces[f]) bows[f] += near[static_cast<std::size_t>(v)] / 3;
  }
  return around_vertices();
}

EdgeCounts count_edges(const TriangleMesh& mesh) {
  EdgeCounts counts;
  for_each_edge(sides_by_edge(mesh), [&](std::span<const FaceSide> sides) {
    counts.boundary += sides.size() == 1;
    counts.non_manifold += sides.size() > 2;
  });
  return counts;
}

TriangleMesh transformed(TriangleMesh mesh, const RigidTransform& world_from_mesh) {
  for (Vec3& v : mesh.vertices) v = world_from_mesh * v;
  return mesh;
}

TriangleMesh make_box(const Vec3& size_mm, const Vec3& center) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i) {
    const Vec3 corner((i & 1) != 0 ? 0.5 : -0.5, (i & 2) != 0 ? 0.5 : -0.5,
                      (i & 4) != 0 ? 0.5 : -0.5);
    mesh.vertices.push_back(center + corner.cwiseProduct(size_mm));
  }
  mesh.faces = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

TriangleMesh make_sphere(double radius_mm, int rings, const Vec3& center) {
  TriangleMesh mesh;
  const int sectors = 2 * rings;
  mesh.vertices.push_back(center + Vec3(0, 0, radius_mm));
  for (int r = 1; r < rings; ++r) {
    const double theta = std::numbers::pi * r / rings;
    for (int s = 0; s < sectors; ++s) {
      const double phi = 2 * std::numbers::pi * s / sectors;
      mesh.vertices.push_back(center + radius_mm * Vec3(std::sin(theta) * std::cos(phi),
                                                        std::sin(theta) * std::sin(phi),
                                                        std::cos(theta)));
    }
  }
  mesh.vertices.push_back(center - Vec3(0, 0, radius_mm));
  const int south = static_cast<int>(mesh.vertices.size()) - 1;
  const auto at = [&](int r, int s) { return 1 + (r - 1) * sectors + s % sectors; };
  for (int s = 0; s < sectors; ++s) {
    mesh.faces.push_back({0, at(1, s), at(1, s + 1)});
    for (int r = 1; r + 1 < rings; ++r) {
      mesh.faces.push_back({at(r, s), at(r + 1, s), at(r + 1, s + 1)});
      mesh.faces.push_back({at(r, s), at(r + 1, s + 1), at(r, s + 1)});
    }
    mesh.faces.push_back({at(rings - 1, s), south, at(rings - 1, s + 1)});
  }
  return mesh;
}

}  // namespace pencilscan
