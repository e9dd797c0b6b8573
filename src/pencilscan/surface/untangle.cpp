#include "pencilscan/surface/untangle.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <unordered_set>

#include "pencilscan/core/check.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/geometry/as_floats.h"
#include "pencilscan/surface/mesh_parts.h"

namespace pencilscan {
namespace {

struct Triangle {
  std::array<Vec3, 3> x;
  Vec3 low, high;  ///< bounding box
};

Triangle triangle(const TriangleMesh& mesh, std::size_t face) {
  Triangle t;
  for (std::size_t k = 0; k < 3; ++k)
    t.x[k] = mesh.vertices[static_cast<std::size_t>(mesh.faces[face][k])];
  t.low = t.x[0].cwiseMin(t.x[1]).cwiseMin(t.x[2]);
  t.high = t.x[0].cwiseMax(t.x[1]).cwiseMax(t.x[2]);
  return t;
}

double volume(const Vec3& o, const Vec3& x, const Vec3& y, const Vec3& z) {
  return (x - o).cross(y - o).dot(z - o);
}

/// True when segment pq passes through the inside of the triangle.
bool pierces(const Vec3& p, const Vec3& q, const std::array<Vec3, 3>& t) {
  if (volume(p, t[0], t[1], t[2]) * volume(q, t[0], t[1], t[2]) >= 0) return false;
  const double ab = volume(p, q, t[0], t[1]);
  const double bc = volume(p, q, t[1], t[2]);
  const double ca = volume(p, q, t[2], t[0]);
  return (ab > 0 && bc > 0 && ca > 0) || (ab < 0 && bc < 0 && ca < 0);
}

bool boxes_touch(const Triangle& a, const Triangle& b) {
  return (a.low.array() <= b.high.array()).all() && (b.low.array() <= a.high.array()).all();
}

bool cut_each_other(const Triangle& a, const Triangle& b) {
  for (std::size_t k = 0; k < 3; ++k) {
    if (pierces(a.x[k], a.x[(k + 1) % 3], b.x) || pierces(b.x[k], b.x[(k + 1) % 3], a.x))
      return true;
  }
  return false;
}

bool have_common_vertex(const std::array<int, 3>& a, const std::array<int, 3>& b) {
  return std::find_first_of(a.begin(), a.end(), b.begin(), b.end()) != a.end();
}

using Cell = std::array<std::int32_t, 3>;

template <class Visit>
void for_each_cell(const Triangle& t, double size, Visit&& visit) {
  Cell low{}, high{};
  for (std::size_t k = 0; k < 3; ++k) {
    const auto axis = static_cast<Eigen::Index>(k);
    low[k] = static_cast<std::int32_t>(std::floor(t.low[axis] / size));
    high[k] = static_cast<std::int32_t>(std::floor(t.high[axis] / size));
  }
  for (auto x = low[0]; x <= high[0]; ++x)
    for (auto y = low[1]; y <= high[1]; ++y)
      for (auto z = low[2]; z <= high[2]; ++z) visit(Cell{x, y, z});
}

/// Twice the mean extent of the faces.
double cell_size(const TriangleMesh& mesh) {
  double size = 0;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const Triangle t = triangle(mesh, f);
    size += (t.high - t.low).maxCoeff();
  }
  return std::max(2 * size / static_cast<double>(mesh.faces.size()), 1e-9);
}

struct CellHash {
  std::size_t operator()(const Cell& c) const {
    return static_cast<std::size_t>(c[0]) * 73856093U ^ static_cast<std::size_t>(c[1]) * 19349663U ^
           static_cast<std::size_t>(c[2]) * 83492791U;
  }
};

/// Faces whose bounding boxes touch the same cube, and at times those of another one.
struct Buckets {
  std::vector<std::size_t> starts;  ///< of each bucket in `faces`, and the end of the last
  std::vector<std::uint32_t> faces;

  explicit Buckets(const TriangleMesh& mesh) : starts(std::bit_ceil(mesh.faces.size()) + 1, 0) {
    const double size = cell_size(mesh);
    const std::size_t mask = starts.size() - 2;
    std::vector<std::uint32_t> bucket_of;
    std::vector<std::size_t> ends;  // of each face in bucket_of
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      for_each_cell(triangle(mesh, f), size, [&](const Cell& cell) {
        const std::size_t bucket = CellHash()(cell) & mask;
        bucket_of.push_back(static_cast<std::uint32_t>(bucket));
        ++starts[bucket + 1];
      });
      ends.push_back(bucket_of.size());
    }
    for (std::size_t k = 1; k < starts.size(); ++k) starts[k] += starts[k - 1];
    faces.resize(bucket_of.size());
    std::vector<std::size_t> next(starts.begin(), starts.end() - 1);
    std::size_t i = 0;
    for (std::size_t f = 0; f < ends.size(); ++f) {
      for (; i < ends[f]; ++i) faces[next[bucket_of[i]]++] = static_cast<std::uint32_t>(f);
    }
  }
};

/// The marked faces and all that share a cell with one of them.
std::vector<std::array<int, 3>> faces_near(const TriangleMesh& mesh, std::span<const char> marked) {
  const double size = cell_size(mesh);
  std::unordered_set<Cell, CellHash> cells;
  for (std::size_t f = 0; f < marked.size(); ++f) {
    if (marked[f] != 0)
      for_each_cell(triangle(mesh, f), size, [&](const Cell& cell) { cells.insert(cell); });
  }
  std::vector<std::array<int, 3>> faces;
  for (std::size_t f = 0; f < marked.size(); ++f) {
    bool is_near = false;
    for_each_cell(triangle(mesh, f), size,
                  [&](const Cell& cell) { is_near = is_near || cells.contains(cell); });
    if (is_near) faces.push_back(mesh.faces[f]);
  }
  return faces;
}

std::vector<char> vertices_of(const TriangleMesh& mesh, std::span<const std::size_t> faces) {
  std::vector<char> marked(mesh.vertices.size(), 0);
  for (const std::size_t f : faces) {
    for (const int v : mesh.faces[f]) marked[static_cast<std::size_t>(v)] = 1;
  }
  return marked;
}

/// Faces with such a vertex.
std::vector<char> faces_at(const TriangleMesh& mesh, std::span<const char> vertices) {
  std::vector<char> marked(mesh.faces.size(), 0);
  for (std::size_t f = 0; f < marked.size(); ++f) {
    for (const int v : mesh.faces[f]) {
      if (vertices[static_cast<std::size_t>(v)] != 0) marked[f] = 1;
    }
  }
  return marked;
}

/// Marked vertices move as their neighbours do in the mean.
void even_out(std::span<const Vec3> before, std::span<const char> marked, TriangleMesh& mesh) {
  std::vector<Vec3> sum(before.size(), Vec3::Zero());
  std::vector<int> count(before.size(), 0);
  for (const auto& face : mesh.faces) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto a = static_cast<std::size_t>(face[k]);
      const auto b = static_cast<std::size_t>(face[(k + 1) % 3]);
      if (marked[a] == 0) continue;
      sum[a] += mesh.vertices[b] - before[b];
      ++count[a];
    }
  }
  for (std::size_t v = 0; v < before.size(); ++v) {
    if (count[v] > 0) mesh.vertices[v] = before[v] + sum[v] / count[v];
  }
}

}  // namespace

std::vector<std::size_t> self_intersections(const TriangleMesh& mesh) {
  constexpr std::size_t kBucketsPerRun = 1024;
  if (mesh.faces.empty()) return {};
  const Buckets buckets(mesh);
  std::vector<std::vector<std::size_t>> found((buckets.starts.size() + kBucketsPerRun - 2) /
                                              kBucketsPerRun);
  parallel_for(found.size(), [&](std::size_t run) {
    std::vector<Triangle> triangles;
    const std::size_t end = std::min((run + 1) * kBucketsPerRun, buckets.starts.size() - 1);
    for (std::size_t k = run * kBucketsPerRun; k < end; ++k) {
      const std::span faces =
          std::span(buckets.faces)
              .subspan(buckets.starts[k], buckets.starts[k + 1] - buckets.starts[k]);
      triangles.clear();
      for (const std::uint32_t f : faces) triangles.push_back(triangle(mesh, f));
      for (std::size_t a = 0; a < faces.size(); ++a) {
        for (std::size_t b = a + 1; b < faces.size(); ++b) {
          if (!boxes_touch(triangles[a], triangles[b]) ||
              have_common_vertex(mesh.faces[faces[a]], mesh.faces[faces[b]]))
            continue;
          if (!cut_each_other(triangles[a], triangles[b])) continue;
          found[run].push_back(faces[a]);
          found[run].push_back(faces[b]);
        }
      }
    }
  });
  std::vector<std::size_t> faces;
  for (const auto& of_run : found) faces.insert(faces.end(), of_run.begin(), of_run.end());
  std::sort(faces.begin(), faces.end());
  faces.erase(std::unique(faces.begin(), faces.end()), faces.end());
  return faces;
}

std::size_t untangle(std::span<const Vec3> before, TriangleMesh& mesh) {
  constexpr int kSmoothings = 4;  // rounds that even moves out; then they are taken back
  constexpr int kRounds = 12;
  constexpr int kFarthest = 1 + (kRounds - kSmoothings) / 2;  // edges around faces
  PENCILSCAN_CHECK(before.size() == mesh.vertices.size());
  TriangleMesh near;  // fewer and fewer faces: those around what moved, then around what is left
  near.vertices.swap(mesh.vertices);
  std::vector<char> moved(before.size(), 0);
  for (std::size_t v = 0; v < moved.size(); ++v) {
    moved[v] = near.vertices[v] != before[v] ? 1 : 0;
    near.vertices[v] = as_floats(near.vertices[v]);
  }
  near.faces = mesh.faces;
  if (2 * std::count(moved.begin(), moved.end(), 1) < std::ssize(moved))
    near.faces = faces_near(near, faces_at(near, grown(near, moved, 2 * kFarthest)));
  std::vector<std::size_t> faces = self_intersections(near);
  for (int round = 0; round < kRounds && !faces.empty(); ++round) {
    const std::vector<char> cut = vertices_of(near, faces);
    const std::vector<char> marked = grown(near, cut, 1 + std::max(0, round - kSmoothings) / 2);
    near.faces = faces_near(near, faces_at(near, grown(near, cut, 2 * kFarthest)));
    if (round < kSmoothings) even_out(before, marked, near);
    for (std::size_t v = 0; v < marked.size(); ++v) {
      if (marked[v] == 0) continue;
      if (round >= kSmoothings) near.vertices[v] = 0.5 * (before[v] + near.vertices[v]);
      near.vertices[v] = as_floats(near.vertices[v]);
    }
    faces = self_intersections(near);
  }
  near.vertices.swap(mesh.vertices);
  return faces.size();
}

}  // namespace pencilscan
