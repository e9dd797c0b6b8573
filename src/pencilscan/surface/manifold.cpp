#include "pencilscan/surface/manifold.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "pencilscan/core/disjoint_sets.h"
#include "pencilscan/geometry/mesh_sides.h"

namespace pencilscan {
namespace {

/// Corners of faces, three per face, that are one vertex.
class Corners {
 public:
  explicit Corners(std::size_t faces) : sets_(3 * faces) {}
  static std::size_t index(int face, int corner) {
    return 3 * static_cast<std::size_t>(face) + static_cast<std::size_t>(corner % 3);
  }
  [[nodiscard]] std::size_t root(std::size_t c) {
    return static_cast<std::size_t>(sets_.root(static_cast<int>(c)));
  }
  /// The two faces go on into each other over this edge.
  void join(const FaceSide& rising, const FaceSide& falling) {
    join(index(rising.face, rising.corner), index(falling.face, falling.corner + 1));
    join(index(rising.face, rising.corner + 1), index(falling.face, falling.corner));
  }

 private:
  void join(std::size_t a, std::size_t b) { sets_.join(static_cast<int>(a), static_cast<int>(b)); }
  DisjointSets sets_;
};

/// Orders the sides of one edge by the angle of their faces around it, from low to high.
void sort_by_angle(const TriangleMesh& mesh, std::vector<FaceSide>& sides) {
  const auto vertex = [&](int v) -> const Vec3& {
    return mesh.vertices[static_cast<std::size_t>(v)];
  };
  const Vec3 axis = (vertex(sides[0].high) - vertex(sides[0].low)).normalized();
  const Vec3 right = axis.unitOrthogonal();
  const Vec3 up = axis.cross(right);
  std::vector<std::pair<double, std::size_t>> order;
  for (std::size_t i = 0; i < sides.size(); ++i) {
    const auto& face = mesh.faces[static_cast<std::size_t>(sides[i].face)];
    const Vec3 d =
        vertex(face[static_cast<std::size_t>((sides[i].corner + 2) % 3)]) - vertex(sides[i].low);
    order.emplace_back(std::atan2(d.dot(up), d.dot(right)), i);
  }
  std::sort(order.begin(), order.end());
  std::vector<FaceSide> sorted;
  for (const auto& [angle, i] : order) sorted.push_back(sides[i]);
  sides = std::move(sorted);
}

/// The faces of an edge with more than two, in pairs (rising, falling). Turning about the edge, a
/// solid wedge begins at a falling side and ends at a rising one.
std::vector<std::pair<FaceSide, FaceSide>> wedges(const TriangleMesh& mesh,
                                                  std::vector<FaceSide> sides) {
  sort_by_angle(mesh, sides);
  std::vector<std::pair<FaceSide, FaceSide>> pairs;
  while (sides.size() >= 2) {
    std::size_t falling = 0;
    while (falling < sides.size() &&
           (sides[falling].rises || !sides[(falling + 1) % sides.size()].rises))
      ++falling;
    if (falling == sides.size()) break;  // all alike: the mesh was not closed here
    const std::size_t rising = (falling + 1) % sides.size();
    pairs.emplace_back(sides[rising], sides[falling]);
    sides.erase(sides.begin() + static_cast<std::ptrdiff_t>(std::max(falling, rising)));
    sides.erase(sides.begin() + static_cast<std::ptrdiff_t>(std::min(falling, rising)));
  }
  return pairs;
}

template <class T>
void copy_entry(std::vector<T>& values, std::size_t from) {
  if (!values.empty()) values.push_back(T(values[from]));
}

int copy_vertex(std::size_t v, TriangleMesh& mesh) {
  mesh.vertices.push_back(Vec3(mesh.vertices[v]));
  copy_entry(mesh.sigma, v);
  copy_entry(mesh.confidence, v);
  copy_entry(mesh.color, v);
  copy_entry(mesh.hole, v);
  return static_cast<int>(mesh.vertices.size() - 1);
}

/// Copies move apart, into their own solid, by a share of their edges that every file holds.
constexpr double kApart = 0.02;

/// Gives every fan of faces around a vertex a vertex of its own. Returns the number of new ones.
std::size_t split_fans(TriangleMesh& mesh) {
  Corners corners(mesh.faces.size());
  for_each_edge(sides_by_edge(mesh), [&](std::span<const FaceSide> sides) {
    if (sides.size() == 2 && sides[0].rises != sides[1].rises) {
      corners.join(sides[0].rises ? sides[0] : sides[1], sides[0].rises ? sides[1] : sides[0]);
    } else if (sides.size() > 2) {
      for (const auto& [rising, falling] : wedges(mesh, {sides.begin(), sides.end()}))
        corners.join(rising, falling);
    }
  });
  // The first fan of a vertex keeps it, the others get a copy.
  const std::size_t before = mesh.vertices.size();
  constexpr std::size_t kNone = static_cast<std::size_t>(-1);
  std::vector<std::size_t> first_fan(before, kNone);
  std::map<std::size_t, int> copies;  // by fan
  std::vector<char> is_split(before, 0);
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    for (int k = 0; k < 3; ++k) {
      int& vertex = mesh.faces[f][static_cast<std::size_t>(k)];
      const auto v = static_cast<std::size_t>(vertex);
      const std::size_t fan = corners.root(Corners::index(static_cast<int>(f), k));
      if (first_fan[v] == kNone) first_fan[v] = fan;
      if (first_fan[v] == fan) continue;
      is_split[v] = 1;
      const auto [copy, is_new] = copies.try_emplace(fan, 0);
      if (is_new) copy->second = copy_vertex(v, mesh);
      vertex = copy->second;
    }
  }
  if (copies.empty()) return 0;
  is_split.resize(mesh.vertices.size(), 1);
  const std::vector<Vec3> normals = vertex_normals(mesh);
  std::vector<double> shortest(mesh.vertices.size(), std::numeric_limits<double>::infinity());
  for (const auto& face : mesh.faces) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto a = static_cast<std::size_t>(face[k]);
      const auto b = static_cast<std::size_t>(face[(k + 1) % 3]);
      const double length = (mesh.vertices[a] - mesh.vertices[b]).norm();
      shortest[a] = std::min(shortest[a], length);
      shortest[b] = std::min(shortest[b], length);
    }
  }
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    if (is_split[v] != 0 && std::isfinite(shortest[v]))
      mesh.vertices[v] -= kApart * shortest[v] * normals[v];
  }
  return copies.size();
}

/// Where one fan passes the same edge twice, all but one pair of its faces get a new vertex on it.
std::size_t split_edges(TriangleMesh& mesh) {
  std::size_t count = 0;
  for (bool found = true; found;) {
    found = false;
    std::vector<char> is_cut(mesh.faces.size(), 0);
    const std::vector<FaceSide> all = sides_by_edge(mesh);
    for_each_edge(all, [&](std::span<const FaceSide> sides) {
      if (sides.size() <= 2) return;
      const auto pairs = wedges(mesh, {sides.begin(), sides.end()});
      for (std::size_t k = 1; k < pairs.size(); ++k) {
        const auto f = static_cast<std::size_t>(pairs[k].first.face);
        const auto g = static_cast<std::size_t>(pairs[k].second.face);
        if (is_cut[f] != 0 || is_cut[g] != 0 || f == g) continue;
        is_cut[f] = is_cut[g] = 1;
        found = true;
        ++count;
        const auto low = static_cast<std::size_t>(sides[0].low);
        const auto high = static_cast<std::size_t>(sides[0].high);
        const Vec3 inwards = -(face_normal(mesh, f) + face_normal(mesh, g));
        const double length = (mesh.vertices[high] - mesh.vertices[low]).norm();
        const int middle = copy_vertex(low, mesh);
        mesh.vertices.back() = 0.5 * (mesh.vertices[low] + mesh.vertices[high]) +
                               kApart * length * inwards.stableNormalized();
        for (const FaceSide& side : {pairs[k].first, pairs[k].second}) {
          auto& face = mesh.faces[static_cast<std::size_t>(side.face)];
          auto rest = face;  // from the middle to the side's end
          rest[static_cast<std::size_t>(side.corner)] = middle;
          face[static_cast<std::size_t>((side.corner + 1) % 3)] = middle;
          mesh.faces.push_back(rest);
        }
      }
    });
  }
  return count;
}

/// Those vertices that do not lie alone at their place, found by a table of places.
std::vector<std::size_t> at_one_place(std::span<const Vec3> places) {
  constexpr std::uint32_t kNone = 0xFFFFFFFFU;
  const auto hash = [](const Vec3& x) {
    std::uint64_t h = 0;
    for (Eigen::Index k = 0; k < 3; ++k) {
      // Plus zero, as minus zero is the same place.
      h = (h ^ std::bit_cast<std::uint64_t>(x[k] + 0.0)) * 0x9E3779B97F4A7C15ULL;
      h ^= h >> 29;
    }
    return h;
  };
  // The first vertex of each place, in a table that is at most half full.
  std::vector<std::uint32_t> first(std::bit_ceil(2 * places.size() + 1), kNone);
  const std::size_t mask = first.size() - 1;
  std::vector<std::size_t> shared;
  for (std::size_t v = 0; v < places.size(); ++v) {
    std::size_t at = hash(places[v]) & mask;
    while (first[at] != kNone && places[first[at]] != places[v]) at = (at + 1) & mask;
    if (first[at] == kNone) {
      first[at] = static_cast<std::uint32_t>(v);
    } else {
      shared.push_back(first[at]);
      shared.push_back(v);
    }
  }
  std::sort(shared.begin(), shared.end());
  shared.erase(std::unique(shared.begin(), shared.end()), shared.end());
  return shared;
}

}  // namespace

std::size_t make_manifold(TriangleMesh& mesh) { return split_fans(mesh) + split_edges(mesh); }

std::size_t separate_vertices(TriangleMesh& mesh) {
  for (Vec3& x : mesh.vertices) {
    // Kept in a variable: with -fno-trapping-math g++ 12 leaves out a cast there and back.
    for (Eigen::Index k = 0; k < 3; ++k) {
      const volatile auto rounded = static_cast<float>(x[k]);
      x[k] = static_cast<double>(rounded);
    }
  }
  const auto key = [&](std::size_t v) {
    const Vec3& x = mesh.vertices[v];
    return std::array<double, 3>{x[0], x[1], x[2]};
  };
  std::size_t moved = 0;
  constexpr int kRounds = 8;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<std::size_t> order = at_one_place(mesh.vertices);
    if (order.empty()) break;
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      return std::pair(key(a), a) < std::pair(key(b), b);
    });
    const std::vector<Vec3> then = mesh.vertices;
    std::size_t now = 0;
    int alike = 0;
    for (std::size_t i = 1; i < order.size(); ++i) {
      alike = then[order[i]] == then[order[i - 1]] ? alike + 1 : 0;
      if (alike == 0) continue;
      // Along the largest coordinate: there floats are farthest apart, and a reader's rounding too.
      Vec3& x = mesh.vertices[order[i]];
      Eigen::Index axis = 0;
      x.cwiseAbs().maxCoeff(&axis);
      auto value = static_cast<float>(x[axis]);
      for (int step = 0; step < 4 * alike; ++step)
        value = std::nextafter(value, std::numeric_limits<float>::infinity());
      x[axis] = static_cast<double>(value);
      ++now;
    }
    moved += now;
    if (now == 0) break;
  }
  return moved;
}

}  // namespace pencilscan
