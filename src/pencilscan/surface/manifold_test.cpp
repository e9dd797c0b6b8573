#include "pencilscan/surface/manifold.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "pencilscan/surface/mesh_parts.h"

namespace pencilscan {
namespace {

/// Two unit cubes of 8 vertices each at these corners; vertices at one place are one.
TriangleMesh touching_boxes(const Vec3& second) {
  TriangleMesh mesh;
  for (const Vec3& center : {Vec3(0, 0, 0), second}) {
    const TriangleMesh box = make_box({1, 1, 1}, center);
    std::vector<int> index;
    for (const Vec3& x : box.vertices) {
      auto at = std::find(mesh.vertices.begin(), mesh.vertices.end(), x);
      if (at == mesh.vertices.end()) at = mesh.vertices.insert(at, x);
      index.push_back(static_cast<int>(at - mesh.vertices.begin()));
    }
    for (const auto& face : box.faces) {
      mesh.faces.push_back({index[static_cast<std::size_t>(face[0])],
                            index[static_cast<std::size_t>(face[1])],
                            index[static_cast<std::size_t>(face[2])]});
    }
  }
  return mesh;
}

TEST(Manifold, BoxesThatTouchInAnEdgeOrACornerAreCutApart) {
  for (const auto& [second, copies] :
       {std::pair(Vec3(1, 1, 0), 2U), std::pair(Vec3(1, 1, 1), 1U)}) {
    TriangleMesh mesh = touching_boxes(second);
    EXPECT_EQ(count_edges(mesh).non_manifold, copies == 2 ? 1U : 0U);
    EXPECT_EQ(make_manifold(mesh), copies);
    EXPECT_EQ(count_edges(mesh).non_manifold, 0U);
    EXPECT_EQ(count_edges(mesh).boundary, 0U);
    EXPECT_EQ(mesh.vertices.size(), 16U);
    EXPECT_NEAR(signed_volume(mesh), 2, 0.1);
    const std::vector<int> component = face_components(mesh);
    EXPECT_EQ(*std::max_element(component.begin(), component.end()), 1);
    EXPECT_EQ(separate_vertices(mesh), 0U);  // the copies lie apart
  }
}

TEST(Manifold, AnEdgeThatOneFanPassesTwiceGetsAVertex) {
  // A pile of four boxes around a gap of none: the two on the diagonal of the lower layer touch in
  // an edge, and the upper ones make them one body.
  TriangleMesh mesh;
  const auto add = [&](const Vec3& center) {
    const TriangleMesh box = make_box({1, 1, 1}, center);
    for (auto face : box.faces) {
      for (int& v : face) {
        const Vec3 x = box.vertices[static_cast<std::size_t>(v)];
        auto at = std::find(mesh.vertices.begin(), mesh.vertices.end(), x);
        if (at == mesh.vertices.end()) at = mesh.vertices.insert(at, x);
        v = static_cast<int>(at - mesh.vertices.begin());
      }
      mesh.faces.push_back(face);
    }
  };
  for (const Vec3& center : {Vec3(0, 0, 0), Vec3(1, 1, 0)}) add(center);
  for (const double z : {-1.0, 1.0}) {
    for (const Vec3& center : {Vec3(0, 0, z), Vec3(1, 0, z), Vec3(0, 1, z), Vec3(1, 1, z)})
      add(center);
  }
  // Faces between two boxes are inside: both go.
  const auto quad_center = [&](std::size_t f) {  // of the box side that the triangle is half of
    const auto& face = mesh.faces[f];
    Vec3 low = mesh.vertices[static_cast<std::size_t>(face[0])], high = low;
    for (const int v : face) {
      low = low.cwiseMin(mesh.vertices[static_cast<std::size_t>(v)]);
      high = high.cwiseMax(mesh.vertices[static_cast<std::size_t>(v)]);
    }
    return Vec3(0.5 * (low + high));
  };
  std::vector<char> keep(mesh.faces.size(), 1);
  for (std::size_t f = 0; f < keep.size(); ++f) {
    for (std::size_t g = 0; g < keep.size(); ++g) {
      if (f / 12 != g / 12 && quad_center(f) == quad_center(g)) keep[f] = 0;
    }
  }
  mesh = submesh(mesh, keep);
  ASSERT_EQ(count_edges(mesh).boundary, 0U);
  ASSERT_EQ(count_edges(mesh).non_manifold, 1U);
  const double volume = signed_volume(mesh);
  EXPECT_EQ(make_manifold(mesh), 1U);
  EXPECT_EQ(count_edges(mesh).boundary, 0U);
  EXPECT_EQ(count_edges(mesh).non_manifold, 0U);
  EXPECT_NEAR(signed_volume(mesh), volume, 0.1);
}

TEST(Manifold, VerticesAtOnePlaceAreMovedApartByTheLeast) {
  TriangleMesh mesh = make_box({1, 1, 1}, {300, 0, 0});
  mesh.vertices[1] = mesh.vertices[0] + Vec3(1e-9, 0, 0);
  mesh.vertices[2] = mesh.vertices[0];
  EXPECT_GE(separate_vertices(mesh), 2U);
  for (std::size_t a = 0; a < 3; ++a) {
    for (std::size_t b = a + 1; b < 3; ++b) {
      EXPECT_NE(mesh.vertices[a], mesh.vertices[b]);
      EXPECT_LT((mesh.vertices[a] - mesh.vertices[b]).norm(), 1e-3);
    }
  }
}

}  // namespace
}  // namespace pencilscan
