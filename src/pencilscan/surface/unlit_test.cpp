#include "pencilscan/surface/unlit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <span>

#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

constexpr double kLinesApart = 8;             // of lines, footprints and pixels
constexpr double kHole = 1.75 * kLinesApart;  // radius

/// One camera above the plane z = 0 and projectors on both sides of it, which show columns. A pixel
/// covers 1.
Rig rig_above(std::size_t projectors) {
  Rig rig;
  rig.cameras = {sample::device_at<Camera>({1e-3, 0, 1000}, "cam", 240, 240, 1000)};
  LinePattern pattern;
  pattern.pitch_px = kLinesApart;
  pattern.line_width_px = kLinesApart / 3;
  pattern.offset_px = kLinesApart / 2;
  for (const double x : {300, -300}) {
    if (rig.projectors.size() == projectors) break;
    rig.projectors.push_back(sample::device_at<Projector>({x, 0, 950}, "proj", 640, 512, 1000));
    rig.projectors.back().patterns = {pattern};
  }
  return rig;
}

TriangleMesh sheet_of_vertices() {
  constexpr int kSide = 60;  // vertices, 2 apart
  TriangleMesh mesh;
  for (int i = 0; i < kSide; ++i)
    for (int k = 0; k < kSide; ++k)
      mesh.vertices.emplace_back(2.0 * (i - kSide / 2), 2.0 * (k - kSide / 2), 0);
  mesh.confidence.assign(mesh.vertices.size(), 0.9F);
  for (int i = 0; i + 1 < kSide; ++i) {
    for (int k = 0; k + 1 < kSide; ++k) {
      const int v = i * kSide + k;
      mesh.faces.push_back({v, v + kSide, v + 1});
      mesh.faces.push_back({v + 1, v + kSide, v + kSide + 1});
    }
  }
  return mesh;
}

/// Share of the light that a place on the plane gives back.
using Albedo = std::function<double(const Vec3&)>;

/// The light of a projector on the plane, as the camera sees it with noise.
cv::Mat seen_light(const Rig& rig, std::size_t projector, const Albedo& albedo) {
  constexpr double kNoise = 0.01;  // of the height of a line
  const Camera& camera = rig.cameras[0];
  const LinePattern& pattern = rig.projectors[projector].patterns[0];
  cv::Mat image(camera.height, camera.width, CV_32F);
  cv::RNG noise(7);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      const Ray ray = camera.ray({u, v});
      const Vec3 x = ray.origin - ray.origin.z() / ray.direction.z() * ray.direction;
      const double panel = (*rig.projectors[projector].project(x))[0] - pattern.offset_px;
      const double off = (panel - pattern.pitch_px * std::round(panel / pattern.pitch_px)) / 1.5;
      image.at<float>(v, u) = static_cast<float>(
          std::max(0.0, albedo(x) * std::exp(-off * off) + noise.gaussian(kNoise)));
    }
  }
  return image;
}

/// The plane as the camera sees it. `albedos`: of each projector's light, which is a family.
CameraLight seen(const Rig& rig, const std::vector<Albedo>& albedos) {
  CameraLight light;
  light.camera = &rig.cameras[0];
  for (std::size_t p = 0; p < albedos.size(); ++p) {
    light.patterns.emplace_back(rig, rig.cameras[0], static_cast<int>(p), 0);
    light.patterns.back().set_family(static_cast<int>(p));
    light.families.push_back(seen_light(rig, p, albedos[p]));
  }
  light.valid = cv::Mat(light.families[0].size(), CV_8U, cv::Scalar(1));
  light.spacing_px = static_cast<float>(kLinesApart);
  return light;
}

double all_white(const Vec3&) { return 1; }

/// White but for a disc.
Albedo with_disc(double radius, double albedo) {
  return [=](const Vec3& x) { return x.norm() < radius ? albedo : 1; };
}

std::vector<char> unlit_of(const std::vector<Albedo>& albedos,
                           const TriangleMesh& scene = sheet_of_vertices(),
                           std::span<const SurfaceEvidence> evidence = {}) {
  const Rig rig = rig_above(albedos.size());
  const CameraLight light = seen(rig, albedos);
  return unlit_vertices(rig, RayScene(scene), {&light, 1}, sheet_of_vertices(), evidence);
}

std::ptrdiff_t count_of(const std::vector<char>& unlit) {
  return std::count(unlit.begin(), unlit.end(), 1);
}

TEST(Unlit, IsAHoleUpToItsRimAndNothingElse) {
  const std::vector<char> unlit = unlit_of({with_disc(kHole, 0)});
  const TriangleMesh mesh = sheet_of_vertices();
  for (std::size_t v = 0; v < unlit.size(); ++v) {
    const double r = mesh.vertices[v].norm();
    if (r > kHole - 3 && r < kHole + 1) continue;  // its rim
    EXPECT_EQ(unlit[v], r < kHole ? 1 : 0) << mesh.vertices[v].transpose();
  }
}

TEST(Unlit, IsWhereOnlyTheLightOfAnotherFamilyIs) {
  const std::vector<char> unlit = unlit_of({all_white, with_disc(kHole, 0)});
  const TriangleMesh mesh = sheet_of_vertices();
  std::ptrdiff_t in_disc = 0;
  for (std::size_t v = 0; v < unlit.size(); ++v) {
    const double r = mesh.vertices[v].norm();
    if (r < kHole / 2) in_disc += unlit[v];
    if (r > kHole + 1) {
      EXPECT_EQ(unlit[v], 0) << mesh.vertices[v].transpose();
    }
  }
  EXPECT_GT(in_disc, 0);
  EXPECT_EQ(count_of(unlit_of({all_white, all_white})), 0);
}

TEST(Unlit, IsNoPaintWhereSeveralCamerasHaveDepth) {
  std::vector<SurfaceEvidence> evidence(sheet_of_vertices().vertices.size());
  const auto count = [&](float cameras, double other_light) {
    for (SurfaceEvidence& e : evidence) e.cameras = cameras;
    return count_of(unlit_of({with_disc(kHole, other_light), with_disc(kHole, 0)},
                             sheet_of_vertices(), evidence));
  };
  EXPECT_GT(count(1, 1), 0);
  EXPECT_EQ(count(2, 1), 0);
  EXPECT_GT(count(2, 0), 0) << "no light of any family";
}

TEST(Unlit, IsNotTheDarkBetweenLines) {
  EXPECT_EQ(count_of(unlit_of({all_white})), 0);
  EXPECT_EQ(count_of(unlit_of({with_disc(kLinesApart / 3, 0)})), 0)
      << "which lines pass on both sides";
}

TEST(Unlit, IsPaintOnlyWhereItGivesNoLineBack) {
  EXPECT_EQ(count_of(unlit_of({with_disc(kHole, 0.08)})), 0);
  EXPECT_GT(count_of(unlit_of({with_disc(kHole, 0.01)})), 0) << "no picture tells it from a hole";
}

TEST(Unlit, IsNotAShadow) {
  TriangleMesh scene = sheet_of_vertices();
  const auto first = static_cast<int>(scene.vertices.size());
  for (const auto& [x, y] : {std::pair(-30, -30), {30, -30}, {30, 30}, {-30, 30}})
    scene.vertices.emplace_back(150 + x, y, 475);  // between the projector and the hole
  scene.faces.push_back({first, first + 1, first + 2});
  scene.faces.push_back({first, first + 2, first + 3});
  EXPECT_EQ(count_of(unlit_of({with_disc(kHole, 0)}, scene)), 0);
}

}  // namespace
}  // namespace pencilscan
