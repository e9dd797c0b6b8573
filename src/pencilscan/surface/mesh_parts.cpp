#include "pencilscan/surface/mesh_parts.h"

#include <numeric>

#include "pencilscan/core/check.h"

namespace pencilscan {

std::vector<int> face_components(const TriangleMesh& mesh) {
  std::vector<int> parent(mesh.vertices.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto at = [&](int v) -> int& { return parent[static_cast<std::size_t>(v)]; };
  const auto find = [&](int v) {
    while (at(v) != v) v = at(v) = at(at(v));
    return v;
  };
  for (const auto& face : mesh.faces) {
    at(find(face[1])) = find(face[0]);
    at(find(face[2])) = find(face[0]);
  }
  std::vector<int> name(mesh.vertices.size(), -1);
  std::vector<int> component(mesh.faces.size());
  int count = 0;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    int& id = name[static_cast<std::size_t>(find(mesh.faces[f][0]))];
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

}  // namespace pencilscan
