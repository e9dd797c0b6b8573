#include "pencilscan/geometry/used_vertices.h"

#include <cstddef>

namespace pencilscan {
namespace {

/// Keeps values[i] of the vertices that have a new index.
template <class Value>
void keep_used(const std::vector<int>& new_index, std::vector<Value>& values) {
  if (values.empty()) return;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < new_index.size(); ++i)
    if (new_index[i] >= 0) values[kept++] = values[i];
  values.resize(kept);
}

}  // namespace

TriangleMesh without_unused_vertices(TriangleMesh mesh) {
  constexpr int kUnused = -1;
  std::vector<int> new_index(mesh.vertices.size(), kUnused);
  for (const auto& face : mesh.faces)
    for (const int corner : face) new_index[static_cast<std::size_t>(corner)] = 0;
  int used = 0;
  for (int& index : new_index)
    if (index != kUnused) index = used++;
  if (static_cast<std::size_t>(used) == mesh.vertices.size()) return mesh;
  keep_used(new_index, mesh.vertices);
  keep_used(new_index, mesh.sigma);
  keep_used(new_index, mesh.confidence);
  keep_used(new_index, mesh.color);
  keep_used(new_index, mesh.hole);
  for (auto& face : mesh.faces)
    for (int& corner : face) corner = new_index[static_cast<std::size_t>(corner)];
  return mesh;
}

}  // namespace pencilscan
