#include "pencilscan/surface/marching_cubes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "pencilscan/core/check.h"

namespace pencilscan {
namespace {

// A cell's corners: bit 0 of a corner's number is x, bit 1 y, bit 2 z. Its edges: 4 * axis + k,
// from the k-th corner whose bit `axis` is 0.

struct CellEdge {
  int from = 0;  ///< corner
  int to = 0;    ///< corner, one further along the axis
  int axis = 0;
  int faces = 0;  ///< bits of the two faces that it lies in: 2 * axis + side
};

std::array<CellEdge, 12> cell_edges() {
  std::array<CellEdge, 12> edges;
  std::size_t e = 0;
  for (int axis = 0; axis < 3; ++axis) {
    for (int corner = 0; corner < 8; ++corner) {
      if ((corner >> axis & 1) != 0) continue;
      CellEdge& edge = edges[e++];
      edge = {corner, corner | 1 << axis, axis, 0};
      for (int across = 0; across < 3; ++across) {
        if (across != axis) edge.faces |= 1 << (2 * across + (corner >> across & 1));
      }
    }
  }
  return edges;
}

/// Corners of a face, counter-clockwise seen from outside the cell.
std::array<int, 4> face_corners(int axis, int side) {
  const int u = 1 << (axis + 1) % 3;
  const int v = 1 << (axis + 2) % 3;
  const int base = side << axis;
  if (side == 1) return {base, base | u, base | u | v, base | v};
  return {base, base | v, base | u | v, base | u};
}

using Triangles = std::vector<std::array<int, 3>>;  // of edges

/// Cuts a loop of edges into triangles whose inner sides lie in no face of the cell: there the next
/// cell could have the same side. False where that cannot be.
bool cut_loop(const std::array<CellEdge, 12>& edges, std::span<const int> loop, Triangles& result) {
  const auto are_in_one_face = [&](int a, int b) {
    return (edges[static_cast<std::size_t>(a)].faces & edges[static_cast<std::size_t>(b)].faces) !=
           0;
  };
  if (loop.size() == 3) {
    result.push_back({loop[0], loop[1], loop[2]});
    return true;
  }
  const std::size_t before = result.size();
  for (std::size_t k = 0; k < loop.size(); ++k) {
    const int a = loop[k];
    const int c = loop[(k + 2) % loop.size()];
    if (are_in_one_face(a, c)) continue;
    result.push_back({a, loop[(k + 1) % loop.size()], c});
    std::vector<int> rest;
    for (std::size_t i = 0; i < loop.size(); ++i) {
      if (i != (k + 1) % loop.size()) rest.push_back(loop[i]);
    }
    if (cut_loop(edges, rest, result)) return true;
    result.resize(before);
  }
  return false;
}

/// Triangles of a cell by the set of its inside corners, and the same with the loops that cannot be
/// cut as a fan.
class CellTable {
 public:
  CellTable() : edges_(cell_edges()) {
    for (int inside = 0; inside < 256; ++inside) make(inside);
  }
  [[nodiscard]] const Triangles& triangles(int inside) const {
    return triangles_[static_cast<std::size_t>(inside)];
  }
  [[nodiscard]] const std::array<CellEdge, 12>& edges() const { return edges_; }

 private:
  [[nodiscard]] int edge_between(int a, int b) const {
    for (std::size_t e = 0; e < edges_.size(); ++e) {
      if ((edges_[e].from == a && edges_[e].to == b) || (edges_[e].from == b && edges_[e].to == a))
        return static_cast<int>(e);
    }
    PENCILSCAN_CHECK(false);
    return 0;
  }

  void make(int inside) {
    // On each face the surface runs around every row of inside corners: from the edge before the
    // row to the one behind it, so that triangles turn counter-clockwise seen from outside the
    // object.
    std::array<int, 12> following;
    following.fill(-1);
    const auto is_inside = [&](int corner) { return (inside >> corner & 1) != 0; };
    for (int axis = 0; axis < 3; ++axis) {
      for (int side = 0; side < 2; ++side) {
        const std::array<int, 4> around = face_corners(axis, side);
        for (std::size_t k = 0; k < 4; ++k) {
          if (is_inside(around[(k + 3) % 4]) || !is_inside(around[k])) continue;
          std::size_t last = k;
          while (is_inside(around[(last + 1) % 4])) ++last;
          const int entry = edge_between(around[(k + 3) % 4], around[k]);
          const int exit = edge_between(around[last % 4], around[(last + 1) % 4]);
          following[static_cast<std::size_t>(entry)] = exit;
        }
      }
    }
    std::array<bool, 12> done{};
    Triangles& triangles = triangles_[static_cast<std::size_t>(inside)];
    for (std::size_t e = 0; e < 12; ++e) {
      if (following[e] < 0 || done[e]) continue;
      std::vector<int> loop;
      for (std::size_t at = e; !done[at]; at = static_cast<std::size_t>(following[at])) {
        done[at] = true;
        loop.push_back(static_cast<int>(at));
      }
      if (cut_loop(edges_, loop, triangles)) continue;
      for (std::size_t k = 2; k < loop.size(); ++k)
        triangles.push_back({loop[0], loop[k - 1], loop[k]});
    }
  }

  std::array<CellEdge, 12> edges_;
  std::array<Triangles, 256> triangles_;
};

}  // namespace

TriangleMesh marching_cubes(const Lattice& lattice, std::span<const float> values,
                            const Vec3& origin, double cell) {
  PENCILSCAN_CHECK(values.size() == lattice.size() && cell > 0);
  constexpr float kLeastShare = 0.02F;  // of an edge, between a vertex and a node
  static const CellTable table;
  TriangleMesh mesh;
  std::array<std::vector<int>, 3> vertex_on;  // of the edge that leaves a node along an axis
  for (std::vector<int>& of_axis : vertex_on) of_axis.assign(lattice.size(), -1);
  const auto inside = [&](int i) { return values[static_cast<std::size_t>(i)] > 0; };
  const auto vertex = [&](std::size_t from, int axis) {
    int& v = vertex_on[static_cast<std::size_t>(axis)][from];
    if (v >= 0) return v;
    v = static_cast<int>(mesh.vertices.size());
    const float a = values[from];
    const float b = values[static_cast<std::size_t>(lattice.next(axis, from))];
    const float share = std::clamp(a / (a - b), kLeastShare, 1 - kLeastShare);
    const Lattice::Node node = lattice.node(from);
    Vec3 x(node[0], node[1], node[2]);
    x[axis] += static_cast<double>(share);
    mesh.vertices.emplace_back(origin + cell * x);
    return v;
  };
  std::array<int, 8> corners;
  for (std::size_t i = 0; i < lattice.size(); ++i) {
    if (!lattice.corners(i, corners)) continue;
    int set = 0;
    for (std::size_t k = 0; k < 8; ++k) set |= inside(corners[k]) ? 1 << k : 0;
    if (set == 0 || set == 255) continue;
    for (const std::array<int, 3>& triangle : table.triangles(set)) {
      std::array<int, 3> face{};
      for (std::size_t k = 0; k < 3; ++k) {
        const CellEdge& edge = table.edges()[static_cast<std::size_t>(triangle[k])];
        face[k] = vertex(static_cast<std::size_t>(corners[static_cast<std::size_t>(edge.from)]),
                         edge.axis);
      }
      mesh.faces.push_back(face);
    }
  }
  return mesh;
}

}  // namespace pencilscan
