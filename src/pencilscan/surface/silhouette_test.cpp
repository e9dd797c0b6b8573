#include "pencilscan/surface/silhouette.h"

#include <gtest/gtest.h>

#include "pencilscan/surface/sample_ball.h"
#include "pencilscan/surface/untangle.h"

namespace pencilscan {
namespace {

using sample::ball_rig;
using sample::hit_ball;
using sample::kMm;
using sample::kRadius;

TEST(Silhouettes, InventedBulgeIsDrawnIn) {
  Rig rig = ball_rig();
  rig.cameras.pop_back();  // nobody sees it from below
  std::vector<Silhouette> silhouettes;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    cv::Mat image(rig.cameras[c].height, rig.cameras[c].width, CV_32FC3, cv::Scalar::all(0.01));
    for (int v = 0; v < image.rows; ++v) {
      for (int u = 0; u < image.cols; ++u) {
        if (hit_ball(rig.cameras[c].ray(Vec2(u, v)))) image.at<cv::Vec3f>(v, u)[1] = 0.5F;
      }
    }
    silhouettes.push_back(silhouette(static_cast<int>(c), image, 4));
  }
  TriangleMesh mesh = make_sphere(kRadius, 48);
  const TriangleMesh ball = mesh;
  constexpr double kBulge = 20 * kMm;
  for (Vec3& x : mesh.vertices) {
    const double down = std::max(0.0, -x.z() / kRadius - 0.5);
    x += kBulge * std::min(1.0, 4 * down) * x.normalized();
    mesh.confidence.push_back(down > 0 ? 0.F : 1.F);
  }
  mesh.sigma.assign(mesh.vertices.size(), sample::kSigma);
  const TriangleMesh bulged = mesh;
  ASSERT_TRUE(self_intersections(bulged).empty());
  EXPECT_GT(carve(rig, silhouettes, {}, mesh), 100U);
  EXPECT_EQ(count_edges(mesh).boundary, 0U);
  const double excess = signed_volume(bulged) - signed_volume(ball);
  EXPECT_LT(signed_volume(mesh) - signed_volume(ball), 0.35 * excess);
  EXPECT_GT(signed_volume(mesh), 0.9 * signed_volume(ball));
  EXPECT_TRUE(self_intersections(mesh).empty());
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    if (mesh.confidence[v] > 0) {
      EXPECT_EQ((mesh.vertices[v] - bulged.vertices[v]).norm(), 0);
    }
  }
  // What is within the silhouettes stays.
  TriangleMesh still = ball;
  still.confidence.assign(still.vertices.size(), 0.F);
  EXPECT_EQ(carve(rig, silhouettes, {}, still), 0U);
}

}  // namespace
}  // namespace pencilscan
