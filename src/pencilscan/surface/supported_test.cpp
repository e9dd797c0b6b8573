#include "pencilscan/surface/supported.h"

#include <gtest/gtest.h>

namespace pencilscan {
namespace {

TEST(Supported, OnlyMeasuredVerticesFarFromEveryPointAreNot) {
  TriangleMesh mesh;
  std::vector<MeasuredPoint> points;
  for (int i = 0; i < 100; ++i) {
    mesh.vertices.emplace_back(0.5 * i, 0, 0);
    mesh.confidence.push_back(i == 99 ? 0.F : 0.9F);           // the last one was invented
    set_position(Vec3(0.1 * i, 1, 0), points.emplace_back());  // up to x = 9.9
  }
  constexpr double kReach = 5;
  const std::vector<char> unsupported = unsupported_vertices(mesh, points, {}, kReach);
  ASSERT_EQ(unsupported.size(), 100U);
  for (std::size_t v = 0; v < 100; ++v) {
    const double x = mesh.vertices[v].x();
    if (x > 14 && x < 15) continue;  // about the reach from the last points, of which some count
    EXPECT_EQ(unsupported[v], x >= 15 && v != 99 ? 1 : 0) << x;
  }
}

TEST(Supported, NorAreThoseNearestToADeniedPlace) {
  TriangleMesh mesh;
  std::vector<MeasuredPoint> points;
  std::vector<MeasuredPoint> denied;
  for (int i = 0; i < 100; ++i) {
    mesh.vertices.emplace_back(0.1 * i, 0, 0);
    mesh.confidence.push_back(0.9F);
  }
  for (int i = 0; i < 8; ++i) {
    set_position(Vec3(2, 0.1 * i, 0), points.emplace_back());
    set_position(Vec3(6, 0.1 * i, 0), denied.emplace_back());
  }
  const std::vector<char> unsupported = unsupported_vertices(mesh, points, denied, 5);
  for (std::size_t v = 0; v < 100; ++v) {
    const double x = mesh.vertices[v].x();
    EXPECT_EQ(unsupported[v], x > 4.01 ? 1 : 0) << x;
  }
}

}  // namespace
}  // namespace pencilscan
