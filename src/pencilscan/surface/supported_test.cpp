#include "pencilscan/surface/supported.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

constexpr double kReach = 5;
constexpr int kLength = 100;  // vertices of a strip

/// Two cameras that look along z, from above and from below.
Rig two_sides() {
  Rig rig;
  for (const double z : {500.0, -500.0})
    rig.cameras.push_back(sample::device_at<Camera>({1e-3, 0, z}, "cam", 640, 480, 1000));
  return rig;
}

/// A strip of the plane z = 0, its two rows 0.2 apart, that faces the camera above.
TriangleMesh strip(double step) {
  TriangleMesh mesh;
  for (const double y : {0.0, 0.2}) {
    for (int i = 0; i < kLength; ++i) {
      mesh.vertices.emplace_back(step * i, y, 0);
      mesh.confidence.push_back(0.9F);
    }
  }
  for (int i = 0; i + 1 < kLength; ++i) {
    mesh.faces.push_back({i, i + 1, kLength + i});
    mesh.faces.push_back({i + 1, kLength + i + 1, kLength + i});
  }
  return mesh;
}

/// Points along x up to `end`, seen by one camera.
std::vector<MeasuredPoint> points_up_to(double end, int camera) {
  std::vector<MeasuredPoint> points;
  for (double x = 0; x < end; x += 0.1) {
    MeasuredPoint& point = points.emplace_back();
    set_position(Vec3(x, 1, 0), point);
    point.camera = static_cast<std::uint8_t>(camera);
  }
  return points;
}

/// Depth of the plane z = 0 in all nodes of a camera.
DepthMap plane_map(const Rig& rig, int camera) {
  DepthMap map;
  map.camera = camera;
  map.columns = (rig.camera(camera).width - 1) / map.stride + 1;
  map.rows = (rig.camera(camera).height - 1) / map.stride + 1;
  map.nodes.resize(static_cast<std::size_t>(map.columns * map.rows));
  for (DepthNode& node : map.nodes) node.w = 1.F / 500;
  return map;
}

TEST(Supported, OnlyMeasuredVerticesFarFromEveryPointAreNot) {
  TriangleMesh mesh = strip(0.5);
  mesh.confidence[kLength - 1] = 0;  // invented
  const std::vector<char> unsupported =
      unsupported_vertices(two_sides(), mesh, {}, points_up_to(10, 0), {}, kReach);
  ASSERT_EQ(unsupported.size(), mesh.vertices.size());
  for (std::size_t v = 0; v < kLength; ++v) {
    const double x = mesh.vertices[v].x();
    if (x > 14 && x < 15) continue;  // about the reach from the last points, of which some count
    EXPECT_EQ(unsupported[v], x >= 15 && v != kLength - 1 ? 1 : 0) << x;
  }
}

TEST(Supported, PointsOfTheOtherSideDoNotCount) {
  const std::vector<char> unsupported =
      unsupported_vertices(two_sides(), strip(0.1), {}, points_up_to(10, 1), {}, kReach);
  EXPECT_EQ(std::count(unsupported.begin(), unsupported.end(), 1), 2 * kLength);
}

TEST(Supported, WhatOneCameraAloneMeasuredNeedsItsOwnPoints) {
  Rig rig = two_sides();
  rig.cameras[1] = rig.cameras[0];  // another one that sees it
  const TriangleMesh mesh = strip(0.1);
  std::vector<MeasuredPoint> points = points_up_to(10, 1);
  for (MeasuredPoint& point : points) point.y = 0.5F * static_cast<float>(kReach);
  const auto count = [&](std::span<const DepthMap> maps) {
    const auto unsupported = unsupported_vertices(rig, mesh, maps, points, {}, kReach);
    return std::count(unsupported.begin(), unsupported.end(), 1);
  };
  const std::vector<DepthMap> maps = {plane_map(rig, 0), plane_map(rig, 1)};
  EXPECT_EQ(count(maps), 0);
  EXPECT_EQ(count({&maps[1], 1}), 0) << "whose points they are";
  EXPECT_EQ(count({&maps[0], 1}), 2 * kLength);
}

TEST(Supported, NorAreThoseNearestToADeniedPlace) {
  std::vector<MeasuredPoint> points;
  std::vector<MeasuredPoint> denied;
  for (int i = 0; i < 8; ++i) {
    set_position(Vec3(2, 0.1 * i, 0), points.emplace_back());
    set_position(Vec3(6, 0.1 * i, 0), denied.emplace_back());
  }
  const TriangleMesh mesh = strip(0.1);
  const auto unsupported = unsupported_vertices(two_sides(), mesh, {}, points, denied, kReach);
  for (std::size_t v = 0; v < kLength; ++v) {
    const double x = mesh.vertices[v].x();
    EXPECT_EQ(unsupported[v], x > 4.01 ? 1 : 0) << x;
  }
}

}  // namespace
}  // namespace pencilscan
