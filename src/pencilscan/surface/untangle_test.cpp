#include "pencilscan/surface/untangle.h"

#include <gtest/gtest.h>

#include "pencilscan/geometry/mesh.h"

namespace pencilscan {
namespace {

TEST(SelfIntersections, AreFound) {
  EXPECT_TRUE(self_intersections(make_sphere(20, 16)).empty());
  TriangleMesh two = make_sphere(20, 16);
  const TriangleMesh other = make_sphere(20, 16, Vec3(15, 1, 2));
  const int shift = static_cast<int>(two.vertices.size());
  two.vertices.insert(two.vertices.end(), other.vertices.begin(), other.vertices.end());
  for (const auto& face : other.faces)
    two.faces.push_back({face[0] + shift, face[1] + shift, face[2] + shift});
  EXPECT_GT(self_intersections(two).size(), 10U);
}

TEST(SelfIntersections, AreTakenBackAndNothingElse) {
  TriangleMesh mesh = make_sphere(20, 24);
  const std::vector<Vec3> before = mesh.vertices;
  // A dent that comes out on the other side, and a small bulge far from it.
  std::size_t bulge = 0;
  for (std::size_t v = 0; v < before.size(); ++v) {
    if (before[v].x() > 19) mesh.vertices[v].x() -= 45;
    if (before[v].z() > before[bulge].z()) bulge = v;
  }
  mesh.vertices[bulge].z() += 1;
  ASSERT_FALSE(self_intersections(mesh).empty());
  EXPECT_EQ(untangle(before, mesh), 0U);
  EXPECT_TRUE(self_intersections(mesh).empty());
  EXPECT_NEAR(mesh.vertices[bulge].z(), before[bulge].z() + 1, 1e-5);
}

}  // namespace
}  // namespace pencilscan
