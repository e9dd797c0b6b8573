#include "pencilscan/geometry/mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <numbers>
#include <span>
#include <vector>

#include "pencilscan/core/parallel.h"
#include "pencilscan/core/random.h"
#include "pencilscan/geometry/as_floats.h"
#include "pencilscan/geometry/mesh_sides.h"
#include "pencilscan/geometry/ray_scene.h"

namespace pencilscan {
namespace {

TEST(TriangleMesh, BoxAndSphereAreClosedOutwardAndOfTheRightVolume) {
  const TriangleMesh box = make_box({2, 3, 4});
  EXPECT_NEAR(signed_volume(box), 24, 1e-12);
  EXPECT_NEAR(surface_area(box), 52, 1e-12);
  EXPECT_EQ(count_edges(box).boundary, 0U);
  const TriangleMesh sphere = make_sphere(10, 64);
  EXPECT_NEAR(signed_volume(sphere), 4.0 / 3 * std::numbers::pi * 1000, 10);  // faceted: < 0.3 %
  EXPECT_EQ(count_edges(sphere).boundary, 0U);
  EXPECT_EQ(count_edges(sphere).non_manifold, 0U);
}

TEST(MeanBows, AreWhatFacesOfABallMiss) {
  constexpr double kBall = 10;
  const TriangleMesh sphere = make_sphere(kBall, 32);
  const std::vector<double> bows = mean_bows(sphere);
  double missing = 0;
  double expected = 0;
  for (std::size_t f = 0; f < sphere.faces.size(); ++f) {
    const auto corner = [&](std::size_t k) {
      return sphere.vertices[static_cast<std::size_t>(sphere.faces[f][k])];
    };
    const double area = (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
    // Exact for quadratic functions: the middles of the sides.
    for (std::size_t k = 0; k < 3; ++k) {
      missing += area / 3 * (kBall - 0.5 * (corner(k) + corner((k + 1) % 3)).norm());
      expected += area / 3 * bows[static_cast<std::size_t>(sphere.faces[f][k])];
    }
  }
  EXPECT_NEAR(expected, missing, 0.02 * missing);
  const std::vector<double> of_box = mean_bows(make_box({1, 2, 3}));
  for (const double bow : of_box) EXPECT_GT(bow, 0);
}

TEST(MeshSides, AreThoseOfASort) {
  Random random(11);
  TriangleMesh mesh;
  mesh.vertices.resize(12);
  const auto other = [&](int than) { return (than + 1 + static_cast<int>(random.below(3))) % 12; };
  std::vector<std::array<int, 4>> expected;  // low, high, face, corner
  for (int f = 0; f < 200; ++f) {
    const int a = static_cast<int>(random.below(12));
    const int b = other(a);
    const std::array<int, 3> face{a, b, other(b) == a ? (a + 6) % 12 : (b + 4) % 12};
    mesh.faces.push_back(face);
    for (int k = 0; k < 3; ++k) {
      const int from = face[static_cast<std::size_t>(k)];
      const int to = face[static_cast<std::size_t>((k + 1) % 3)];
      expected.push_back({std::min(from, to), std::max(from, to), f, k});
    }
  }
  std::sort(expected.begin(), expected.end());
  const std::vector<FaceSide> sides = sides_by_edge(mesh);
  ASSERT_EQ(sides.size(), expected.size());
  std::size_t edges = 0;
  for_each_edge(sides, [&](std::span<const FaceSide> of_edge) {
    ++edges;
    EXPECT_EQ(of_edge.front().high, of_edge.back().high);
  });
  EXPECT_GT(edges, 12U);
  for (std::size_t i = 0; i < sides.size(); ++i) {
    const FaceSide& s = sides[i];
    EXPECT_EQ((std::array{s.low, s.high, s.face, static_cast<int>(s.corner)}), expected[i]);
    const std::array<int, 3>& face = mesh.faces[static_cast<std::size_t>(s.face)];
    EXPECT_EQ(s.rises, face[static_cast<std::size_t>(s.corner)] == s.low);
  }
}

TEST(RayScene, HitsTheBoxWhereGeometrySays) {
  const RayScene scene(make_box({100, 100, 100}));
  const auto hit = scene.first_hit({{500, 10, 20}, {-1, 0, 0}});
  ASSERT_TRUE(hit);
  EXPECT_NEAR(hit->distance, 450, 1e-9);
  EXPECT_FALSE(scene.first_hit({{500, 60, 20}, {-1, 0, 0}}));
  EXPECT_TRUE(scene.visible({500, 0, 0}, {50, 0, 0}, 0.1));
  EXPECT_FALSE(scene.visible({500, 0, 0}, {-50, 0, 0}, 0.1));
}

TEST(RayScene, ClosestPointAgreesWithBruteForceOverSamples) {
  const TriangleMesh sphere = make_sphere(50, 24);
  const RayScene scene(sphere);
  Random random(3);
  for (int i = 0; i < 50; ++i) {
    const Vec3 p(random.uniform(-90, 90), random.uniform(-90, 90), random.uniform(-90, 90));
    const auto closest = scene.closest_point(p);
    ASSERT_TRUE(closest);
    double nearest_vertex = 1e9;
    for (const Vec3& v : sphere.vertices) nearest_vertex = std::min(nearest_vertex, (v - p).norm());
    EXPECT_LE(closest->distance, nearest_vertex + 1e-9);
    EXPECT_NEAR(closest->distance, std::abs(p.norm() - 50), 0.5);  // facet sagitta below 0.5 mm
  }
}

TEST(RayScene, LeavesThreadsToOthersWhileItLives) {
  const int before = thread_count();
  const RayScene scene(make_sphere(10));
  EXPECT_EQ(thread_count(), before);
}

TEST(AsFloats, RoundsEveryCoordinate) {
  std::vector<Vec3> points(100, Vec3(0.1, 0.3, 0.7));
  for (Vec3& x : points) x = as_floats(x);
  for (const Vec3& x : points) {
    EXPECT_EQ(x[0], 0x1.99999ap-4);
    EXPECT_EQ(x[1], 0x1.333334p-2);
    EXPECT_EQ(x[2], 0x1.666666p-1);
  }
}

}  // namespace
}  // namespace pencilscan
