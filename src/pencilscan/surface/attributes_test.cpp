#include "pencilscan/surface/attributes.h"

#include <gtest/gtest.h>

#include <cmath>

namespace pencilscan {
namespace {

constexpr int kSide = 11;       // vertices
constexpr double kSpacing = 1;  // mm, of vertices and samples

/// A flat piece with a sample at every vertex, all seen at one cosine.
std::vector<SurfaceSample> flat_samples(double cosine, TriangleMesh& mesh) {
  std::vector<SurfaceSample> samples;
  for (int row = 0; row < kSide; ++row) {
    for (int column = 0; column < kSide; ++column) {
      mesh.vertices.push_back(kSpacing * Vec3(column, row, 0));
      SurfaceSample& s = samples.emplace_back();
      s.position = mesh.vertices.back();
      s.normal = Vec3::UnitZ();
      s.to_camera = Vec3(std::sqrt(1 - cosine * cosine), 0, cosine);
      s.sheet_normal = Vec3::UnitX();
      s.sigma = 0.02;
      s.confidence = 1;
      s.spacing = kSpacing;
      if (row + 1 == kSide || column + 1 == kSide) continue;
      const int v = row * kSide + column;
      mesh.faces.push_back({v, v + 1, v + kSide});
      mesh.faces.push_back({v + 1, v + kSide + 1, v + kSide});
    }
  }
  return samples;
}

std::size_t measured_vertices(double cosine) {
  TriangleMesh mesh;
  const auto samples = flat_samples(cosine, mesh);
  (void)attribute_vertices(samples, 2, kSpacing, mesh);
  std::size_t count = 0;
  for (const float confidence : mesh.confidence) count += confidence > 0 ? 1U : 0U;
  return count;
}

TEST(Attributes, WhatTurnsAwayFromItsCamerasIsNotMeasured) {
  EXPECT_EQ(measured_vertices(0.9), static_cast<std::size_t>(kSide * kSide));
  EXPECT_EQ(measured_vertices(0.25), static_cast<std::size_t>(kSide * kSide));
  EXPECT_EQ(measured_vertices(0.15), 0U);
}

}  // namespace
}  // namespace pencilscan
