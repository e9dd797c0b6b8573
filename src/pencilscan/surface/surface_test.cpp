#include "pencilscan/surface/surface.h"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "pencilscan/core/error.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/surface/sample_ball.h"

namespace pencilscan {
namespace {

using sample::ball_points;
using sample::ball_rig;
using sample::expect_watertight;
using sample::kMm;
using sample::kRadius;
using sample::share_beyond;
using sample::worst_deviation;

/// Moves pieces of curves (camera, projector, line) along their camera rays by 8 to 30 mm, as a
/// wrong line label does.
void mislabel(const Rig& rig, double share, std::vector<MeasuredPoint>& points) {
  for (MeasuredPoint& p : points) {
    const std::uint64_t piece = (((p.camera * 64ULL + p.projector) * 1024ULL) + p.line) * 64ULL +
                                static_cast<std::uint64_t>(p.v / 40);
    Random random(7, piece);
    if (random.uniform() >= share) continue;
    const double shift = random.uniform(8, 30) * kMm * (random.uniform() < 0.5 ? -1 : 1);
    const Vec3 x(p.x, p.y, p.z);
    const Vec3 moved = x + shift * (rig.cameras[p.camera].center() - x).normalized();
    p.x = static_cast<float>(moved.x());
    p.y = static_cast<float>(moved.y());
    p.z = static_cast<float>(moved.z());
  }
}

/// Coarser than the default: the ball needs no finer cells, and the tests run under sanitizers.
SurfaceOptions test_options() {
  SurfaceOptions options;
  options.cell_spacings = 0.5;
  return options;
}

bool equal_bytes(const TriangleMesh& a, const TriangleMesh& b) {
  const auto same = [](const auto& x, const auto& y) {
    return x.size() == y.size() &&
           (x.empty() || std::memcmp(x.data(), y.data(), x.size() * sizeof(x[0])) == 0);
  };
  return same(a.vertices, b.vertices) && same(a.faces, b.faces) && same(a.sigma, b.sigma) &&
         same(a.confidence, b.confidence);
}

TEST(Surface, BallIsClosedAndAccurate) {
  const Rig rig = ball_rig();
  const std::vector<MeasuredPoint> points = ball_points(rig);
  const SurfaceResult result = reconstruct_surface(rig, points, test_options());
  expect_watertight(result);
  // Three sigma of the noise, which the fit averages down except at the rims.
  EXPECT_LT(worst_deviation(result.mesh), 0.3 * kMm);
  const double volume = 4.0 / 3 * std::numbers::pi * std::pow(kRadius, 3);
  EXPECT_NEAR(signed_volume(result.mesh) / volume, 1, 0.005);
  EXPECT_GT(result.report.measured_share, 0.98);
  EXPECT_GT(result.report.points_used, points.size() * 99 / 100);
}

TEST(Surface, SameBytesForAnyThreadCount) {
  const Rig rig = ball_rig();
  std::vector<MeasuredPoint> points = ball_points(rig);
  std::erase_if(points, [](const MeasuredPoint& p) { return p.projector > 2; });
  std::vector<SurfaceResult> results;
  for (const int threads : {1, 2, 4}) {
    const ThreadLimit limit(threads);
    results.push_back(reconstruct_surface(rig, points, test_options()));
  }
  ASSERT_FALSE(results[0].measured.faces.empty());
  for (std::size_t i = 1; i < results.size(); ++i) {
    EXPECT_TRUE(equal_bytes(results[0].mesh, results[i].mesh));
    EXPECT_TRUE(equal_bytes(results[0].measured, results[i].measured));
  }
}

TEST(Surface, WrongLabelsAreVotedOut) {
  const Rig rig = ball_rig();
  std::vector<MeasuredPoint> points = ball_points(rig);
  const std::vector<MeasuredPoint> truth = points;
  mislabel(rig, 0.15, points);
  const SurfaceResult result = reconstruct_surface(rig, points, test_options());
  expect_watertight(result);
  // The few wrong pieces that stay bend the surface here and there, by far less than they are off.
  EXPECT_LT(worst_deviation(result.mesh), 1.5 * kMm);
  EXPECT_LT(share_beyond(result.mesh, 0.3 * kMm), 0.02);
  std::size_t wrong = 0;
  std::size_t wrong_used = 0;
  std::size_t right_used = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool moved = points[i].x != truth[i].x;
    wrong += moved;
    wrong_used += moved && result.used[i];
    right_used += !moved && result.used[i];
  }
  EXPECT_LT(wrong_used, wrong / 30);
  EXPECT_GT(right_used, (points.size() - wrong) * 95 / 100);
}

TEST(Surface, HalfBallIsMeasuredHalfAndClosed) {
  const Rig rig = ball_rig();
  std::vector<MeasuredPoint> points = ball_points(rig);
  std::erase_if(points, [](const MeasuredPoint& p) { return p.x < 0; });
  const SurfaceResult result = reconstruct_surface(rig, points, test_options());
  expect_watertight(result);
  const double half = 2 * std::numbers::pi * kRadius * kRadius;
  // The rim lies within one line spacing (3.8 mm) of the last points: 8 % of the half's height.
  EXPECT_NEAR(surface_area(result.measured) / half, 1, 0.08);
  EXPECT_GT(count_edges(result.measured).boundary, 0u);
  for (const Vec3& v : result.measured.vertices) EXPECT_GT(v.x(), -6 * kMm);
  double guessed = 0;
  for (std::size_t v = 0; v < result.mesh.vertices.size(); ++v) {
    if (result.mesh.vertices[v].x() < -10 * kMm) {
      EXPECT_EQ(result.mesh.confidence[v], 0.0F);
      EXPECT_GT(double{result.mesh.sigma[v]}, kMm);
      ++guessed;
    }
  }
  EXPECT_GT(guessed, 100);
}

TEST(Surface, TwoCamerasAndOneProjectorGiveAClosedSurface) {
  Rig rig = ball_rig();
  std::vector<MeasuredPoint> points = ball_points(rig);
  std::erase_if(points, [](const MeasuredPoint& p) { return p.camera > 1 || p.projector != 0; });
  const SurfaceResult result = reconstruct_surface(rig, points, test_options());
  EXPECT_EQ(count_edges(result.mesh).boundary, 0u);
  EXPECT_LT(worst_deviation(result.measured), kMm);
  EXPECT_GT(surface_area(result.measured), 0.15 * surface_area(result.mesh));
}

TEST(Surface, FarFloatersNeitherStayNorStretchTheCube) {
  const Rig rig = ball_rig();
  std::vector<MeasuredPoint> points = ball_points(rig);
  const std::size_t count = points.size();
  for (std::size_t i = 0; i < count; i += 400) {  // agreeing wrong patches, 2000 mm off
    MeasuredPoint p = points[i];
    p.x += static_cast<float>(2000 * kMm);
    points.push_back(p);
  }
  const SurfaceResult result = reconstruct_surface(rig, points, test_options());
  expect_watertight(result);
  EXPECT_LT(worst_deviation(result.mesh), 0.5 * kMm);
  for (std::size_t i = count; i < points.size(); ++i) EXPECT_EQ(result.used[i], 0);
}

TEST(Surface, TooFewPointsIsAStatus) {
  const Rig rig = ball_rig();
  const std::vector<MeasuredPoint> points = ball_points(rig);
  for (const std::size_t count : {std::size_t{0}, std::size_t{1}, std::size_t{20}}) {
    const SurfaceResult result = reconstruct_surface(rig, std::span(points).first(count));
    EXPECT_EQ(result.report.status, SurfaceStatus::kTooFewPoints);
    EXPECT_TRUE(result.mesh.faces.empty());
    EXPECT_FALSE(result.report.warnings.empty());
  }
}

TEST(Surface, BadPointsAreLeftOutOrNamed) {
  const Rig rig = ball_rig();
  std::vector<MeasuredPoint> points = ball_points(rig);
  points.resize(10);
  points[3].x = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(reconstruct_surface(rig, points).report.points, 9u);
  points[4].camera = 77;
  EXPECT_THROW(static_cast<void>(reconstruct_surface(rig, points)), InputError);
}

}  // namespace
}  // namespace pencilscan
