#include "pencilscan/surface/mesh_parts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "pencilscan/geometry/mesh.h"

namespace pencilscan {
namespace {

TEST(MeshParts, CapsCloseEveryLoop) {
  TriangleMesh mesh = make_sphere(20, 16);
  const double volume = signed_volume(mesh);
  std::vector<char> keep;  // two loops: a zone of the ball
  for (std::size_t f = 0; f < mesh.faces.size(); ++f)
    keep.push_back(std::abs(mesh.vertices[static_cast<std::size_t>(mesh.faces[f][0])].z()) < 15);
  mesh = submesh(mesh, keep);
  ASSERT_GT(count_edges(mesh).boundary, 20U);
  const TriangleMesh closed = with_caps(mesh);
  EXPECT_EQ(count_edges(closed).boundary, 0U);
  EXPECT_EQ(count_edges(closed).non_manifold, 0U);
  EXPECT_EQ(closed.vertices.size(), mesh.vertices.size() + 2);
  EXPECT_GT(signed_volume(closed), 0.7 * volume);  // outward like the rest
  EXPECT_EQ(with_caps(closed).faces, closed.faces);
}

TEST(MeshParts, SubdivisionKeepsTheShape) {
  const TriangleMesh ball = make_sphere(20, 12);
  const TriangleMesh fine = subdivided(ball);
  EXPECT_EQ(fine.faces.size(), 4 * ball.faces.size());
  EXPECT_EQ(count_edges(fine).boundary, 0u);
  EXPECT_NEAR(signed_volume(fine), signed_volume(ball), 1e-6 * signed_volume(ball));
}

TEST(MeshParts, ComponentsAndSubmeshOfTwoBoxes) {
  TriangleMesh mesh = make_box(Vec3::Ones());
  const TriangleMesh other = make_box(Vec3::Ones(), Vec3(5, 0, 0));
  const int shift = static_cast<int>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), other.vertices.begin(), other.vertices.end());
  for (auto face : other.faces)
    mesh.faces.push_back({face[0] + shift, face[1] + shift, face[2] + shift});
  const std::vector<int> component = face_components(mesh);
  std::vector<char> keep;
  for (const int c : component) keep.push_back(c == 1);
  const TriangleMesh part = submesh(mesh, keep);
  EXPECT_EQ(part.vertices.size(), other.vertices.size());
  EXPECT_EQ(part.faces, other.faces);
}

}  // namespace
}  // namespace pencilscan
