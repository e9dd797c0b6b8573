#include "pencilscan/surface/untangle.h"

#include <gtest/gtest.h>

#include "pencilscan/core/random.h"
#include "pencilscan/geometry/as_floats.h"
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

TEST(SelfIntersections, AreAllFoundByLookingAtEveryPairAlone) {
  TriangleMesh mesh = make_sphere(20, 16);
  Random random(7);
  for (Vec3& x : mesh.vertices)
    x = as_floats(x + Vec3(random.normal(), random.normal(), random.normal()));
  // Far from the origin floats are coarse.
  for (Vec3& x : mesh.vertices) x = as_floats(x + Vec3(4000, -3000, 2000));
  std::vector<char> is_found(mesh.faces.size(), 0);
  for (std::size_t a = 0; a < mesh.faces.size(); ++a) {
    for (std::size_t b = a + 1; b < mesh.faces.size(); ++b) {
      TriangleMesh pair;
      pair.vertices = mesh.vertices;
      pair.faces = {mesh.faces[a], mesh.faces[b]};
      if (!self_intersections(pair).empty()) is_found[a] = is_found[b] = 1;
    }
  }
  std::vector<std::size_t> expected;
  for (std::size_t f = 0; f < is_found.size(); ++f)
    if (is_found[f] != 0) expected.push_back(f);
  ASSERT_GT(expected.size(), 20U);
  EXPECT_EQ(self_intersections(mesh), expected);
}

TEST(Untangle, LeavesAsManyAsItSays) {
  const TriangleMesh ball = make_sphere(20, 24);
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    TriangleMesh mesh = ball;
    Random random(seed);
    for (Vec3& x : mesh.vertices)
      x += (seed > 2 ? 2.0 : 1.0) * Vec3(random.normal(), random.normal(), random.normal());
    ASSERT_FALSE(self_intersections(mesh).empty());
    const std::size_t left = untangle(ball.vertices, mesh);
    EXPECT_EQ(self_intersections(mesh).size(), left) << seed;
  }
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
