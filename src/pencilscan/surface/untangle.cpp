#include "pencilscan/surface/untangle.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <utility>

#include "pencilscan/core/check.h"
#include "pencilscan/core/chunks.h"
#include "pencilscan/geometry/as_floats.h"
#include "pencilscan/surface/mesh_parts.h"

namespace pencilscan {
namespace {

struct Triangle {
  std::array<Vec3, 3> x;
  Vec3 low, high;  ///< bounding box
  Vec3 normal;     ///< of twice the area as its length
};

Triangle triangle(const TriangleMesh& mesh, std::size_t face) {
  Triangle t;
  for (std::size_t k = 0; k < 3; ++k)
    t.x[k] = mesh.vertices[static_cast<std::size_t>(mesh.faces[face][k])];
  t.low = t.x[0].cwiseMin(t.x[1]).cwiseMin(t.x[2]);
  t.high = t.x[0].cwiseMax(t.x[1]).cwiseMax(t.x[2]);
  t.normal = (t.x[1] - t.x[0]).cross(t.x[2] - t.x[0]);
  return t;
}

double volume(const Vec3& o, const Vec3& x, const Vec3& y, const Vec3& z) {
  return (x - o).cross(y - o).dot(z - o);
}

bool boxes_touch(const Triangle& a, const Triangle& b) {
  return (a.low.array() <= b.high.array()).all() && (b.low.array() <= a.high.array()).all();
}

/// A bounding box in floats, four at once: a quick look before that at the box itself.
struct FloatBox {
  Eigen::Array4f low, high;

  FloatBox() = default;
  explicit FloatBox(const Triangle& t) : low(Eigen::Array4f::Zero()), high(low) {
    constexpr float kRounding =
        1e-6F;  // of a coordinate, more than floats and their difference lose
    low.head<3>() = t.low.cast<float>().array();
    high.head<3>() = t.high.cast<float>().array();
    low -= kRounding * low.abs();
    high += kRounding * high.abs();
  }
};

bool boxes_touch(const FloatBox& a, const FloatBox& b) {
  return (a.low - b.high).max(b.low - a.high).maxCoeff() <= 0;
}

/// Of the corners of `t` over the plane of `base`, times the length of its normal.
std::array<double, 3> heights(const Triangle& t, const Triangle& base) {
  const auto height = [&](std::size_t k) { return base.normal.dot(t.x[k] - base.x[0]); };
  return {height(0), height(1), height(2)};
}

bool on_one_side(const std::array<double, 3>& heights) {
  return (heights[0] > 0 && heights[1] > 0 && heights[2] > 0) ||
         (heights[0] < 0 && heights[1] < 0 && heights[2] < 0);
}

/// True when an edge of `t` passes through the inside of `base`.
bool pierces(const Triangle& t, const std::array<double, 3>& heights, const Triangle& base) {
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t next = (k + 1) % 3;
    if (heights[k] * heights[next] >= 0) continue;
    const auto beside = [&](std::size_t side) {
      return volume(t.x[k], t.x[next], base.x[side], base.x[(side + 1) % 3]);
    };
    if (on_one_side({beside(0), beside(1), beside(2)})) return true;
  }
  return false;
}

bool cut_each_other(const Triangle& a, const Triangle& b) {
  const std::array<double, 3> of_a = heights(a, b);
  if (on_one_side(of_a)) return false;
  const std::array<double, 3> of_b = heights(b, a);
  if (on_one_side(of_b)) return false;
  return pierces(a, of_a, b) || pierces(b, of_b, a);
}

bool have_common_vertex(const std::array<int, 3>& a, const std::array<int, 3>& b) {
  // Without branches: of faces in one place, a third or so have one.
  const auto is_of_b = [&](int v) { return (v == b[0]) | (v == b[1]) | (v == b[2]); };
  return is_of_b(a[0]) | is_of_b(a[1]) | is_of_b(a[2]);
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

constexpr std::size_t kFacesPerRun = 4096;

/// Twice the mean extent of the faces.
double cell_size(const TriangleMesh& mesh) {
  const double sum =
      sum_of_runs(mesh.faces.size(), kFacesPerRun, 0.0, [&](std::size_t from, std::size_t to) {
        double size = 0;
        for (std::size_t f = from; f < to; ++f) {
          const Triangle t = triangle(mesh, f);
          size += (t.high - t.low).maxCoeff();
        }
        return size;
      });
  return std::max(2 * sum / static_cast<double>(mesh.faces.size()), 1e-9);
}

std::size_t hash(const Cell& c) {
  return static_cast<std::size_t>(c[0]) * 73856093U ^ static_cast<std::size_t>(c[1]) * 19349663U ^
         static_cast<std::size_t>(c[2]) * 83492791U;
}

/// Faces whose bounding boxes touch the same cube, and at times those of another one.
struct Buckets {
  std::vector<std::uint32_t> starts;  ///< of each bucket in `faces`, and the end of the last
  std::vector<std::uint32_t> faces;
  std::vector<FloatBox> boxes;  ///< of each face of the mesh

  explicit Buckets(const TriangleMesh& mesh)
      : starts(std::bit_ceil(mesh.faces.size()) + 1, 0), boxes(mesh.faces.size()) {
    const double size = cell_size(mesh);
    const std::size_t mask = starts.size() - 2;
    struct Entry {
      std::uint32_t bucket, face;
    };
    std::vector<std::vector<Entry>> runs((mesh.faces.size() + kFacesPerRun - 1) / kFacesPerRun);
    parallel_for(runs.size(), [&](std::size_t r) {
      runs[r].reserve(4 * kFacesPerRun);
      const std::size_t end = std::min(mesh.faces.size(), (r + 1) * kFacesPerRun);
      for (std::size_t f = r * kFacesPerRun; f < end; ++f) {
        const Triangle t = triangle(mesh, f);
        boxes[f] = FloatBox(t);
        for_each_cell(t, size, [&](const Cell& cell) {
          runs[r].push_back(
              {static_cast<std::uint32_t>(hash(cell) & mask), static_cast<std::uint32_t>(f)});
        });
      }
    });
    std::size_t count = 0;
    for (const auto& run : runs) {
      count += run.size();
      for (const Entry& entry : run) ++starts[entry.bucket + 1];
    }
    for (std::size_t k = 1; k < starts.size(); ++k) starts[k] += starts[k - 1];
    faces.resize(count);
    std::vector<std::uint32_t> next(starts.begin(), starts.end() - 1);
    for (const auto& run : runs) {
      for (const Entry& entry : run) faces[next[entry.bucket]++] = entry.face;
    }
  }
};

/// The faces that share a cell with one that has such a vertex, at times others.
std::vector<std::array<int, 3>> faces_near(const TriangleMesh& mesh, const FacesOf& faces_of,
                                           std::span<const std::size_t> vertices) {
  const double size = cell_size(mesh);
  std::vector<char> is_taken(std::bit_ceil(4 * mesh.faces.size()), 0);  // cells, by their hash
  const std::size_t mask = is_taken.size() - 1;
  for (const std::size_t v : vertices) {
    for (const std::uint32_t f : faces_of[v])
      for_each_cell(triangle(mesh, f), size,
                    [&](const Cell& cell) { is_taken[hash(cell) & mask] = 1; });
  }
  std::vector<char> is_near(mesh.faces.size(), 0);
  parallel_chunks(is_near.size(), [&](std::size_t f) {
    for_each_cell(triangle(mesh, f), size, [&](const Cell& cell) {
      if (is_taken[hash(cell) & mask] != 0) is_near[f] = 1;
    });
  });
  std::vector<std::array<int, 3>> faces;
  for (std::size_t f = 0; f < is_near.size(); ++f) {
    if (is_near[f] != 0) faces.push_back(mesh.faces[f]);
  }
  return faces;
}

/// The corners of some faces, each once.
std::vector<std::size_t> vertices_of(const TriangleMesh& mesh, std::span<const std::size_t> faces) {
  std::vector<std::size_t> vertices;
  for (const std::size_t f : faces) {
    for (const int v : mesh.faces[f]) vertices.push_back(static_cast<std::size_t>(v));
  }
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  return vertices;
}

/// Vertices move as their neighbours do in the mean.
void even_out(std::span<const Vec3> before, std::span<const std::size_t> vertices,
              const FacesOf& faces, TriangleMesh& mesh) {
  std::vector<Vec3> move;
  for (const std::size_t v : vertices) {
    Vec3 sum = Vec3::Zero();
    for (const std::uint32_t f : faces[v]) {
      const std::size_t next = next_around(mesh.faces[f], v);
      sum += mesh.vertices[next] - before[next];
    }
    move.emplace_back(sum / static_cast<double>(faces[v].size()));
  }
  for (std::size_t i = 0; i < vertices.size(); ++i)
    mesh.vertices[vertices[i]] = before[vertices[i]] + move[i];
}

}  // namespace

std::vector<std::size_t> self_intersections(const TriangleMesh& mesh) {
  constexpr std::size_t kBucketsPerRun = 1024;
  if (mesh.faces.empty()) return {};
  const Buckets buckets(mesh);
  std::vector<std::vector<std::size_t>> found((buckets.starts.size() + kBucketsPerRun - 2) /
                                              kBucketsPerRun);
  parallel_for(found.size(), [&](std::size_t run) {
    std::vector<FloatBox> boxes;
    std::vector<std::array<int, 3>> corners;
    std::vector<std::size_t> touching;
    const std::size_t end = std::min((run + 1) * kBucketsPerRun, buckets.starts.size() - 1);
    for (std::size_t k = run * kBucketsPerRun; k < end; ++k) {
      const std::span faces =
          std::span(buckets.faces)
              .subspan(buckets.starts[k], buckets.starts[k + 1] - buckets.starts[k]);
      if (faces.size() < 2) continue;
      boxes.clear();
      corners.clear();
      for (const std::uint32_t f : faces) {
        boxes.push_back(buckets.boxes[f]);
        corners.push_back(mesh.faces[f]);
      }
      touching.resize(faces.size());
      for (std::size_t a = 0; a + 1 < faces.size(); ++a) {
        // Without branches: every second pair touches, at random.
        std::size_t count = 0;
        for (std::size_t b = a + 1; b < faces.size(); ++b) {
          touching[count] = b;
          count += boxes_touch(boxes[a], boxes[b]) ? 1 : 0;
        }
        std::size_t apart = 0;
        for (std::size_t i = 0; i < count; ++i) {
          const std::size_t b = touching[i];
          touching[apart] = b;
          apart += have_common_vertex(corners[a], corners[b]) ? 0 : 1;
        }
        for (std::size_t i = 0; i < apart; ++i) {
          const Triangle of_a = triangle(mesh, faces[a]);
          const Triangle of_b = triangle(mesh, faces[touching[i]]);
          if (!boxes_touch(of_a, of_b) || !cut_each_other(of_a, of_b)) continue;
          found[run].push_back(faces[a]);
          found[run].push_back(faces[touching[i]]);
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
  std::vector<std::size_t> moved;
  for (std::size_t v = 0; v < before.size(); ++v) {
    if (near.vertices[v] != before[v]) moved.push_back(v);
    near.vertices[v] = as_floats(near.vertices[v]);
  }
  if (!moved.empty()) near.faces = mesh.faces;
  if (!moved.empty() && 2 * moved.size() < before.size()) {
    const FacesOf faces_of(near);
    near.faces =
        faces_near(near, faces_of, around(near, faces_of, std::move(moved), 2 * kFarthest));
  }
  std::vector<std::size_t> faces = self_intersections(near);
  std::vector<std::size_t> cut = vertices_of(near, faces);
  for (int round = 0; round < kRounds && !faces.empty(); ++round) {
    const FacesOf faces_of(near);
    const std::vector<std::size_t> marked =
        around(near, faces_of, cut, 1 + std::max(0, round - kSmoothings) / 2);
    auto fewer = faces_near(near, faces_of, around(near, faces_of, cut, 2 * kFarthest));
    if (round < kSmoothings) even_out(before, marked, faces_of, near);
    for (const std::size_t v : marked) {
      if (round >= kSmoothings) near.vertices[v] = 0.5 * (before[v] + near.vertices[v]);
      near.vertices[v] = as_floats(near.vertices[v]);
    }
    // What cut each other has moved, and so has all that may do so now.
    near.faces = faces_near(near, faces_of, marked);
    faces = self_intersections(near);
    cut = vertices_of(near, faces);
    near.faces = std::move(fewer);
  }
  near.vertices.swap(mesh.vertices);
  return faces.size();
}

}  // namespace pencilscan
