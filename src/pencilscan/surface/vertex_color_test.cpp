#include "pencilscan/surface/vertex_color.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "pencilscan/core/median.h"
#include "pencilscan/surface/sample_ball.h"

namespace pencilscan {
namespace {

using sample::ball_rig;
using sample::hit_ball;
using sample::kDistance;
using sample::kMm;
using sample::kRadius;

/// Images of the ball under all patterns: albedo times light, one sample per pixel.
std::vector<ColorView> ball_images(const Rig& rig, const std::function<Vec3(const Vec3&)>& albedo,
                                   const Vec3& ambient) {
  std::vector<ColorView> views;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const Camera& camera = rig.cameras[c];
    ColorView view;
    view.camera = static_cast<int>(c);
    view.image = cv::Mat(camera.height, camera.width, CV_32FC3, cv::Scalar::all(0));
    view.blur_px = 0.3;
    view.is_plain = camera.sees_texture_only;
    for (int v = 0; v < camera.height; ++v) {
      for (int u = 0; u < camera.width; ++u) {
        const auto x = hit_ball(camera.ray(Vec2(u, v)));
        if (!x) continue;
        Vec3 light = ambient;
        for (const Projector& projector : rig.projectors) {
          const Vec3 way = projector.center() - *x;
          const double cosine = way.normalized().dot(x->normalized());
          const auto pixel = projector.project(*x);
          if (!(cosine > 0) || camera.sees_texture_only) continue;
          const LinePattern& pattern = projector.patterns[0];
          const double px = (*pixel)[pattern.axis == Axis::kColumn ? 0 : 1];
          const Rgb color = pattern.value(px, projector.size_across(pattern), 1.0);
          const double near = kDistance / way.norm();
          light += near * near * cosine * Vec3(color[0], color[1], color[2]);
        }
        const Vec3 seen = albedo(*x).cwiseProduct(light);
        view.image.at<cv::Vec3f>(v, u) = {static_cast<float>(seen[0]), static_cast<float>(seen[1]),
                                          static_cast<float>(seen[2])};
      }
    }
    views.push_back(std::move(view));
  }
  return views;
}

/// Blue/cyan and red/yellow lines in turn: together they show all channels.
Rig color_rig() {
  Rig rig = ball_rig();
  for (std::size_t p = 1; p < rig.projectors.size(); p += 2)
    rig.projectors[p].patterns[0].colors = {"red", "yellow"};
  rig.volume = Sphere{Vec3::Zero(), 60 * kMm};
  return rig;
}

/// Red below, green above, a soft border between them.
Vec3 two_colors(const Vec3& x) {
  const double up = 1 / (1 + std::exp(-x.z() / (5 * kMm)));
  return (1 - up) * Vec3(0.8, 0.3, 0.2) + up * Vec3(0.2, 0.6, 0.4);
}

/// Median over vertices of the largest difference of a channel, after the common factor.
double color_error(const TriangleMesh& mesh, std::span<const std::array<float, 3>> colors) {
  double right = 0;
  double weight = 0;
  for (std::size_t v = 0; v < colors.size(); ++v) {
    for (int c = 0; c < 3; ++c) {
      const double truth = two_colors(mesh.vertices[v])[c];
      const auto found = static_cast<double>(colors[v][static_cast<std::size_t>(c)]);
      right += truth * found;
      weight += found * found;
    }
  }
  std::vector<double> errors;
  for (std::size_t v = 0; v < colors.size(); ++v) {
    double error = 0;
    for (int c = 0; c < 3; ++c) {
      const auto found = static_cast<double>(colors[v][static_cast<std::size_t>(c)]);
      error = std::max(error, std::abs(right / weight * found - two_colors(mesh.vertices[v])[c]));
    }
    errors.push_back(error);
  }
  return upper_median(std::move(errors));
}

TEST(VertexColors, AlbedoFromPatternLight) {
  const Rig rig = color_rig();
  const TriangleMesh mesh = make_sphere(kRadius, 48);
  const auto colors =
      vertex_colors(rig, RayScene(mesh), ball_images(rig, two_colors, Vec3(0.01, 0.02, 0.03)));
  ASSERT_EQ(colors.size(), mesh.vertices.size());
  // Each channel falls on a third of the surface: the rest is filled in from neighbours.
  EXPECT_LT(color_error(mesh, colors), 0.06);
}

TEST(VertexColors, TextureCamerasCountAlone) {
  Rig rig = color_rig();
  for (Camera& camera : rig.cameras) camera.sees_texture_only = true;
  rig.cameras[0].sees_texture_only = false;
  const TriangleMesh mesh = make_sphere(kRadius, 48);
  std::vector<ColorView> views = ball_images(rig, two_colors, Vec3::Ones());
  views[0].image.setTo(0.5);  // would spoil it
  EXPECT_LT(color_error(mesh, vertex_colors(rig, RayScene(mesh), views)), 0.01);
}

TEST(VertexColors, NothingSeenGivesNone) {
  const Rig rig = color_rig();
  const TriangleMesh mesh = make_sphere(kRadius, 12);
  EXPECT_TRUE(vertex_colors(rig, RayScene(mesh), {}).empty());
  std::vector<ColorView> views = ball_images(rig, two_colors, Vec3::Zero());
  for (ColorView& view : views) view.image.setTo(std::nanf(""));
  EXPECT_TRUE(vertex_colors(rig, RayScene(mesh), views).empty());
}

}  // namespace
}  // namespace pencilscan
