#include "pencilscan/surface/untangle.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <unordered_set>

#include "pencilscan/core/check.h"
#include "pencilscan/core/chunks.h"
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

bool cut_each_other(const Triangle& a, const Triangle& b) {
  if ((a.low.array() > b.high.array()).any() || (b.low.array() > a.high.array()).any())
    return false;
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

/// A face in one of the cubes that its bounding box touches.
struct CellEntry {
  Cell cell;
  std::uint32_t face;
  friend auto operator<=>(const CellEntry&, const CellEntry&) = default;
};

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

/// All faces by cells, sorted.
std::vector<CellEntry> cells_of(const TriangleMesh& mesh) {
  const double size = cell_size(mesh);
  std::vector<CellEntry> entries;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    for_each_cell(triangle(mesh, f), size, [&](const Cell& cell) {
      entries.push_back({cell, static_cast<std::uint32_t>(f)});
    });
  }
  std::sort(entries.begin(), entries.end());
  return entries;
}

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
  if (mesh.faces.empty()) return {};
  const std::vector<CellEntry> entries = cells_of(mesh);
  std::vector<std::size_t> starts;  // of the cells
  for (std::size_t i = 0; i < entries.size(); ++i) {
    if (i == 0 || entries[i].cell != entries[i - 1].cell) starts.push_back(i);
  }
  starts.push_back(entries.size());
  std::vector<std::vector<std::size_t>> found(starts.size() - 1);
  parallel_chunks(found.size(), [&](std::size_t c) {
    thread_local std::vector<Triangle> triangles;
    triangles.clear();
    for (std::size_t i = starts[c]; i < starts[c + 1]; ++i)
      triangles.push_back(triangle(mesh, entries[i].face));
    for (std::size_t a = 0; a < triangles.size(); ++a) {
      for (std::size_t b = a + 1; b < triangles.size(); ++b) {
        const std::size_t face_a = entries[starts[c] + a].face;
        const std::size_t face_b = entries[starts[c] + b].face;
        if (have_common_vertex(mesh.faces[face_a], mesh.faces[face_b])) continue;
        if (cut_each_other(triangles[a], triangles[b]))
          found[c].insert(found[c].end(), {face_a, face_b});
      }
    }
  });
  std::vector<std::size_t> faces;
  for (const auto& of_cell : found) faces.insert(faces.end(), of_cell.begin(), of_cell.end());
  std::sort(faces.begin(), faces.end());
  faces.erase(std::unique(faces.begin(), faces.end()), faces.end());
  return faces;
}

std::size_t untangle(std::span<const Vec3> before, TriangleMesh& mesh) {
  constexpr int kSmoothings = 4;  // rounds that even moves out; then they are taken back
  constexpr int kRounds = 12;
  constexpr int kFarthest = 1 + (kRounds - kSmoothings) / 2;  // edges around faces
  PENCILSCAN_CHECK(before.size() == mesh.vertices.size());
  const auto as_in_files = [](Vec3& x) { x = x.cast<float>().cast<double>(); };
  for (Vec3& x : mesh.vertices) as_in_files(x);
  std::vector<std::size_t> faces = self_intersections(mesh);
  if (faces.empty()) return 0;
  TriangleMesh near;  // fewer and fewer faces: those around what is left
  near.vertices.swap(mesh.vertices);
  near.faces = mesh.faces;
  for (int round = 0; round < kRounds && !faces.empty(); ++round) {
    const std::vector<char> cut = vertices_of(near, faces);
    const std::vector<char> marked = grown(near, cut, 1 + std::max(0, round - kSmoothings) / 2);
    near.faces = faces_near(near, faces_at(near, grown(near, cut, 2 * kFarthest)));
    if (round < kSmoothings) even_out(before, marked, near);
    for (std::size_t v = 0; v < marked.size(); ++v) {
      if (marked[v] == 0) continue;
      if (round >= kSmoothings) near.vertices[v] = 0.5 * (before[v] + near.vertices[v]);
      as_in_files(near.vertices[v]);
    }
    faces = self_intersections(near);
  }
  near.vertices.swap(mesh.vertices);
  return faces.size();
}

}  // namespace pencilscan
