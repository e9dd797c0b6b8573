#include "pencilscan/surface/mesh_parts.h"

#include <algorithm>
#include <map>
#include <utility>

#include "pencilscan/core/check.h"
#include "pencilscan/core/disjoint_sets.h"
#include "pencilscan/geometry/mesh_sides.h"

namespace pencilscan {

std::vector<int> face_components(const TriangleMesh& mesh) {
  DisjointSets sets(mesh.vertices.size());
  for (const auto& face : mesh.faces) {
    sets.join(face[0], face[1]);
    sets.join(face[0], face[2]);
  }
  std::vector<int> name(mesh.vertices.size(), -1);
  std::vector<int> component(mesh.faces.size());
  int count = 0;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    int& id = name[static_cast<std::size_t>(sets.root(mesh.faces[f][0]))];
    if (id < 0) id = count++;
    component[f] = id;
  }
  return component;
}

TriangleMesh submesh(const TriangleMesh& mesh, std::span<const char> keep_face) {
  PENCILSCAN_CHECK(keep_face.size() == mesh.faces.size());
  std::vector<int> new_index(mesh.vertices.size(), -1);
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    if (!keep_face[f]) continue;
    for (const int v : mesh.faces[f]) new_index[static_cast<std::size_t>(v)] = 0;
  }
  TriangleMesh part;
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    if (new_index[v] < 0) continue;
    new_index[v] = static_cast<int>(part.vertices.size());
    part.vertices.push_back(mesh.vertices[v]);
    if (!mesh.sigma.empty()) part.sigma.push_back(mesh.sigma[v]);
    if (!mesh.confidence.empty()) part.confidence.push_back(mesh.confidence[v]);
    if (!mesh.color.empty()) part.color.push_back(mesh.color[v]);
    if (!mesh.hole.empty()) part.hole.push_back(mesh.hole[v]);
  }
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    if (!keep_face[f]) continue;
    auto face = mesh.faces[f];
    for (int& v : face) v = new_index[static_cast<std::size_t>(v)];
    part.faces.push_back(face);
  }
  return part;
}

double face_area(const TriangleMesh& mesh, std::size_t face) {
  const auto& f = mesh.faces[face];
  const Vec3& a = mesh.vertices[static_cast<std::size_t>(f[0])];
  const Vec3& b = mesh.vertices[static_cast<std::size_t>(f[1])];
  const Vec3& c = mesh.vertices[static_cast<std::size_t>(f[2])];
  return 0.5 * (b - a).cross(c - a).norm();
}

TriangleMesh subdivided(const TriangleMesh& mesh, std::vector<std::array<int, 2>>* middles) {
  if (middles != nullptr) middles->clear();
  TriangleMesh fine = mesh;
  fine.faces.clear();
  fine.faces.reserve(4 * mesh.faces.size());
  fine.vertices.reserve(mesh.vertices.size() + 3 * mesh.faces.size() / 2);
  // Edges by their lower vertex: the other one, and the new vertex between them.
  std::vector<std::size_t> ends(mesh.vertices.size() + 1, 0);
  for (const auto& face : mesh.faces) {
    for (std::size_t k = 0; k < 3; ++k)
      ++ends[static_cast<std::size_t>(std::min(face[k], face[(k + 1) % 3])) + 1];
  }
  for (std::size_t v = 1; v < ends.size(); ++v) ends[v] += ends[v - 1];
  struct Edge {
    int high, middle;
  };
  std::vector<Edge> edges(3 * mesh.faces.size());
  std::vector<std::size_t> first(ends.begin(), ends.end() - 1);
  ends.assign(first.begin(), first.end());
  const auto middle = [&](int a, int b) {
    const auto low = static_cast<std::size_t>(std::min(a, b));
    const int high = std::max(a, b);
    for (std::size_t e = first[low]; e < ends[low]; ++e) {
      if (edges[e].high == high) return edges[e].middle;
    }
    const int added = static_cast<int>(fine.vertices.size());
    edges[ends[low]++] = {high, added};
    if (middles != nullptr) middles->push_back({a, b});
    const auto i = static_cast<std::size_t>(a);
    const auto j = static_cast<std::size_t>(b);
    fine.vertices.push_back(0.5 * (mesh.vertices[i] + mesh.vertices[j]));
    if (!mesh.sigma.empty()) fine.sigma.push_back(0.5F * (mesh.sigma[i] + mesh.sigma[j]));
    // Between a measured and an invented vertex nothing was measured.
    if (!mesh.confidence.empty()) {
      const bool both = mesh.confidence[i] > 0 && mesh.confidence[j] > 0;
      fine.confidence.push_back(both ? 0.5F * (mesh.confidence[i] + mesh.confidence[j]) : 0.F);
    }
    return added;
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

FacesOf::FacesOf(const TriangleMesh& mesh) : begin_(mesh.vertices.size() + 1, 0) {
  for (const auto& face : mesh.faces) {
    for (const int v : face) ++begin_[static_cast<std::size_t>(v) + 1];
  }
  for (std::size_t v = 1; v < begin_.size(); ++v) begin_[v] += begin_[v - 1];
  faces_.resize(begin_.back());
  std::vector<std::uint32_t> next(begin_.begin(), begin_.end() - 1);
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    for (const int v : mesh.faces[f])
      faces_[next[static_cast<std::size_t>(v)]++] = static_cast<std::uint32_t>(f);
  }
}

std::vector<std::size_t> around(const TriangleMesh& mesh, const FacesOf& faces,
                                std::vector<std::size_t> marked, int edges,
                                const std::function<bool(std::size_t)>& may_join) {
  std::vector<char> is_marked(mesh.vertices.size(), 0);
  for (const std::size_t v : marked) is_marked[v] = 1;
  std::size_t begin = 0;
  for (int edge = 0; edge < edges; ++edge) {
    const std::size_t end = marked.size();
    for (; begin < end; ++begin) {
      for (const std::uint32_t f : faces[marked[begin]]) {
        for (const int vertex : mesh.faces[f]) {
          const auto v = static_cast<std::size_t>(vertex);
          if (is_marked[v] != 0 || (may_join && !may_join(v))) continue;
          is_marked[v] = 1;
          marked.push_back(v);
        }
      }
    }
  }
  return marked;
}

TriangleMesh with_caps(TriangleMesh mesh) {
  PENCILSCAN_CHECK(mesh.sigma.empty() && mesh.confidence.empty() && mesh.hole.empty() &&
                   mesh.color.empty());
  // Open edges by their start; where two loops touch in a vertex there are several.
  std::multimap<int, int> open;
  for_each_edge(sides_by_edge(mesh), [&](std::span<const FaceSide> sides) {
    const auto rising =
        std::count_if(sides.begin(), sides.end(), [](const FaceSide& side) { return side.rises; });
    if (rising != 0 && rising != std::ssize(sides)) return;
    for (const FaceSide& side : sides)
      open.emplace(side.rises ? side.low : side.high, side.rises ? side.high : side.low);
  });
  while (!open.empty()) {
    std::vector<int> loop;
    for (auto edge = open.begin(); edge != open.end(); edge = open.find(loop.back())) {
      if (loop.empty()) loop.push_back(edge->first);
      loop.push_back(edge->second);
      open.erase(edge);
      if (loop.back() == loop.front()) break;
    }
    if (loop.size() < 4 || loop.back() != loop.front()) continue;
    Vec3 mean = Vec3::Zero();
    for (std::size_t k = 1; k < loop.size(); ++k)
      mean += mesh.vertices[static_cast<std::size_t>(loop[k])];
    const int center = static_cast<int>(mesh.vertices.size());
    mesh.vertices.emplace_back(mean / static_cast<double>(loop.size() - 1));
    for (std::size_t k = 1; k < loop.size(); ++k)
      mesh.faces.push_back({loop[k], loop[k - 1], center});
  }
  return mesh;
}

}  // namespace pencilscan
