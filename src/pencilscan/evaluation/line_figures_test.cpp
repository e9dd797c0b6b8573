#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "pencilscan/core/random.h"
#include "pencilscan/evaluation/label_error.h"
#include "pencilscan/evaluation/synthetic_oracle.h"

namespace pencilscan {
namespace {

constexpr int kRings = 90;  // facets of 3.5 mm, 0.015 mm inside the ideal sphere at most
// The facets move a line sideways by their sag times the tangent of the viewing angle: < 0.05 px.
constexpr double kFacetPx = 0.05;

TriangleMesh plate() { return make_box({600, 600, 10}, {0, 0, -5}); }

class SphereFigures : public ::testing::Test {
 protected:
  Rig rig = oracle::ring(3);
  TruthScene truth{make_sphere(oracle::kRadiusMm, kRings), rig};
  std::vector<MeasuredPoint> points = oracle::sphere_points(rig);

  std::vector<TrueLinePixel> true_lines() const {
    std::vector<TrueLinePixel> all;
    for (int c = 0; c < 3; ++c) {
      const auto lines = true_line_pixels(truth, c);
      all.insert(all.end(), lines.begin(), lines.end());
    }
    return all;
  }
};

TEST(TruthScene, LineGradientIsTheInverseSpacingOnAPlane) {
  const auto plane = oracle::plane_scene();
  const TruthScene truth(plate(), plane.rig);
  const auto sample = sample_line(truth, 0, {0, 0}, {40, 30});
  ASSERT_TRUE(sample);
  EXPECT_NEAR(sample->gradient.x(), 1 / plane.spacing_px, 1e-6);
  EXPECT_NEAR(sample->gradient.y(), 0, 1e-6);
}

TEST(TruthScene, FacesOfAClosedMeshMayPointInwards) {
  const auto plane = oracle::plane_scene();
  TriangleMesh inside_out = plate();
  for (auto& face : inside_out.faces) std::swap(face[0], face[1]);
  EXPECT_GT(signed_volume(TruthScene(inside_out, plane.rig).scene().mesh()), 0);
}

TEST(TruthScene, ProjectorBehindAnObstacleDoesNotLight) {
  const auto plane = oracle::plane_scene();
  TriangleMesh mesh = plate();
  // A wall halfway between the projector and the plane, left of it the camera sees the plane.
  const TriangleMesh wall = make_box({60, 60, 10}, {80, 0, 500});
  const int shift = static_cast<int>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), wall.vertices.begin(), wall.vertices.end());
  for (const auto& f : wall.faces) mesh.faces.push_back({f[0] + shift, f[1] + shift, f[2] + shift});
  const TruthScene truth(mesh, plane.rig);
  // The wall's shadow on z = 0 reaches from x = -0.4 mm - 40 to 120 (projector at x = 100).
  EXPECT_FALSE(sample_line(truth, 0, {0, 0}, {79.5 + 20, 59.5}));
  EXPECT_TRUE(sample_line(truth, 0, {0, 0}, {79.5 - 20, 59.5}));
}

TEST(TrueLines, LieAtTheClosedFormOnAPlaneOncePerRow) {
  const auto plane = oracle::plane_scene();
  const TruthScene truth(plate(), plane.rig);
  const auto lines = true_line_pixels(truth, 0);
  std::size_t expected = 0;
  for (int i = 0; i < 84; ++i) {
    if (plane.column(i) >= 0 && plane.column(i) <= 159) expected += 120;
  }
  EXPECT_EQ(lines.size(), expected);
  for (const TrueLinePixel& t : lines) {
    EXPECT_NEAR(t.pixel.x(), plane.column(t.line), 1e-3);
    EXPECT_NEAR(t.spacing_px, plane.spacing_px, 1e-4);
    EXPECT_NEAR(std::abs(t.across.x()), 1, 1e-6);
  }
}

TEST(TrueLines, DistanceIsTheClosedFormOnAPlane) {
  const auto plane = oracle::plane_scene();
  const TruthScene truth(plate(), plane.rig);
  const int line = static_cast<int>(plane.rig.projectors[0].patterns[0].coordinate(400));
  const Vec2 pixel(plane.column(line) + 0.37, 60);
  EXPECT_NEAR(distance_to_true_line(truth, 0, {0, 0}, line, pixel), 0.37, 1e-3);
}

TEST_F(SphereFigures, PerfectPointsHaveNoLabelErrorAndAreAllRecalled) {
  ASSERT_GT(points.size(), 5000U);
  const auto figures = label_figures(truth, points, judge_points(truth, points));
  EXPECT_EQ(figures.wrong.hits, 0U);
  EXPECT_LT(figures.line_error_median_px, kFacetPx);
  EXPECT_EQ(figures.largest_wrong_patch_mm2, 0);
  const auto recall = line_recall(rig, true_lines(), points);
  EXPECT_GT(recall.recall.count, 5000U);
  EXPECT_GT(recall.recall.value(), 0.999);
  EXPECT_GT(recall.any_line.value(), 0.999);
  for (const Share& s : recall.by_projector) EXPECT_GT(s.value(), 0.999);
}

TEST_F(SphereFigures, RecallIsTheShareOfThePointsKept) {
  std::vector<MeasuredPoint> kept;
  for (const auto& p : points) {
    if (p.camera == 0) kept.push_back(p);
  }
  const auto truth_lines = true_lines();
  Share in_camera_0;
  constexpr double kMinSpacingPx = 5;
  const double limit = std::cos(75 * std::numbers::pi / 180);
  for (const TrueLinePixel& t : truth_lines) {
    if (t.spacing_px < kMinSpacingPx || t.cos_camera < limit || t.cos_projector < limit) continue;
    in_camera_0.add(t.camera == 0);
  }
  const auto recall = line_recall(rig, truth_lines, kept);
  EXPECT_EQ(recall.recall.count, in_camera_0.count);
  EXPECT_NEAR(recall.recall.value(), in_camera_0.value(), 0.001);
}

TEST_F(SphereFigures, ShiftedLabelsAreAllWrong) {
  const auto before = judge_points(truth, points);
  std::vector<MeasuredPoint> shifted;
  for (std::size_t i = 0; i < points.size(); ++i) {
    // One pixel of tolerance and one of the disc: a neighbour at 5 px can never be meant.
    if (!before[i].spacing_px || *before[i].spacing_px < 5) continue;
    shifted.push_back(points[i]);
    ++shifted.back().line;
  }
  ASSERT_GT(shifted.size(), 3000U);
  const auto figures = label_figures(truth, shifted, judge_points(truth, shifted));
  constexpr double kRim = 0.001;  // at the rim the spacing falls within the two pixels
  EXPECT_GT(figures.wrong.value(), 1 - kRim);
  EXPECT_GT(figures.largest_wrong_patch_mm2, 5000);
  const auto recall = line_recall(rig, true_lines(), shifted);
  EXPECT_LT(recall.recall.value(), 0.01);
  EXPECT_GT(recall.any_line.value(), 0.99);
}

TEST_F(SphereFigures, BandsOfConfidenceHoldTheShareThatIsRight) {
  points.resize(2000);
  std::vector<PointVerdict> verdicts(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i].confidence = i < 1000 ? 0.85F : 1.F;
    verdicts[i].right = i < 1000 ? i % 5 != 0 : i % 100 != 0;
  }
  int bands = 0;
  for (const ConfidenceBand& band : label_figures(truth, points, verdicts).right_by_confidence) {
    const bool is_low = band.low == 0.8;
    const bool is_high = band.low == 0.999;
    bands += is_low || is_high ? 1 : 0;
    EXPECT_EQ(band.right.count, is_low || is_high ? 1000U : 0U) << band.low;
    if (!is_low && !is_high) continue;
    EXPECT_NEAR(band.confidence_sum, is_low ? 850 : 1000, 1e-3);
    EXPECT_NEAR(band.right.value(), is_low ? 0.8 : 0.99, 1e-9);
  }
  EXPECT_EQ(bands, 2);
}

TEST_F(SphereFigures, RepeatedVerticesCountOnce) {
  auto twice = points;
  twice.insert(twice.end(), points.begin(), points.end());
  for (std::size_t i = 0; i < 100; ++i) ++twice[i].line;
  const auto once = label_figures(truth, points, judge_points(truth, points));
  const auto figures = label_figures(truth, twice, judge_points(truth, twice));
  EXPECT_GE(figures.wrong.count, once.wrong.count);
  EXPECT_LE(figures.wrong.count, once.wrong.count + 100);
}

TEST_F(SphereFigures, DetectionLevelKnowsNoLabels) {
  std::vector<DetectedPoint> detected;
  for (const auto& p : points) {
    detected.push_back({p.camera, static_cast<double>(p.u), static_cast<double>(p.v)});
  }
  const auto family = pattern_channels(rig);
  const auto figures = detection_figures(true_lines(), detected, family);
  EXPECT_GT(figures.recall.value(), 0.999);
  EXPECT_LT(figures.error_median_px, kFacetPx);
  for (auto& d : detected) d.u += 1000;
  const auto away = detection_figures(true_lines(), detected, family);
  EXPECT_EQ(away.recall.hits, 0U);
  EXPECT_EQ(away.spurious.hits, away.spurious.count);
}

TEST(DetectionFigures, ErrorIsTheShiftAcrossTheLine) {
  const auto plane = oracle::plane_scene();
  const TruthScene truth(plate(), plane.rig);
  const auto lines = true_line_pixels(truth, 0);
  std::vector<DetectedPoint> detected;
  for (const auto& t : lines) detected.push_back({0, t.pixel.x() + 0.3, t.pixel.y() + 0.4});
  const auto figures = detection_figures(lines, detected, pattern_channels(plane.rig));
  EXPECT_NEAR(figures.error_median_px, 0.3, 1e-3);
  EXPECT_NEAR(figures.error_p90_px, 0.3, 1e-3);
}

TEST(WrongPatch, AreaIsTheOneOnThePlane) {
  const auto plane = oracle::plane_scene();
  const TruthScene truth(plate(), plane.rig);
  std::vector<MeasuredPoint> points;
  std::size_t lines_wrong = 0;
  for (int line = 0; line < 84; ++line) {
    const double u = plane.column(line);
    if (u < 0 || u > 159) continue;
    const bool wrong_line = u > 40 && u < 100;
    lines_wrong += wrong_line ? 1 : 0;
    for (int y = 0; y < 120; ++y) {
      MeasuredPoint p;
      p.u = static_cast<float>(u);
      p.v = static_cast<float>(y);
      p.line = static_cast<std::uint16_t>(line + (wrong_line && y >= 20 && y < 80 ? 3 : 0));
      points.push_back(p);
    }
  }
  const auto verdicts = judge_points(truth, points);
  // A camera pixel is 1 mm on the plane; a line owns its spacing, a row a pixel.
  const double expected = static_cast<double>(lines_wrong) * plane.spacing_px * 60;
  constexpr double kPixelEdges = 0.03;  // whole pixels at the border
  EXPECT_NEAR(largest_wrong_patch_mm2(truth, points, verdicts), expected, kPixelEdges * expected);
}

TEST(LabelError, TwoPatternsOfOneProjectorAreToldApart) {
  auto plane = oracle::plane_scene();
  plane.rig.projectors[0].patterns.push_back(oracle::pattern(Axis::kRow, 12));
  const TruthScene truth(plate(), plane.rig);
  const auto lines = true_line_pixels(truth, 0);
  std::vector<MeasuredPoint> points;
  for (const auto& t : lines) {
    MeasuredPoint p;
    p.u = static_cast<float>(t.pixel.x());
    p.v = static_cast<float>(t.pixel.y());
    p.line = static_cast<std::uint16_t>(t.line);
    p.pattern = static_cast<std::uint8_t>(t.channel.pattern);
    points.push_back(p);
  }
  EXPECT_EQ(label_figures(truth, points, judge_points(truth, points)).wrong.hits, 0U);
  for (auto& p : points) p.pattern = static_cast<std::uint8_t>(1 - p.pattern);
  EXPECT_GT(label_figures(truth, points, judge_points(truth, points)).wrong.value(), 0.5);
}

TEST(SigmaFigures, ConstantSigmaHasNoRankCorrelation) {
  Random random(1);
  std::vector<MeasuredPoint> points(2000);
  std::vector<PointVerdict> verdicts(2000);
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i].sigma = 1;
    verdicts[i].ray_error_mm = std::abs(random.normal());
  }
  EXPECT_EQ(sigma_figures(points, verdicts).rank_correlation, 0);
}

TEST(SigmaFigures, HonestSigmaIsRecognised) {
  Random random(2);
  constexpr std::size_t kCount = 20000;
  std::vector<MeasuredPoint> points(kCount);
  std::vector<PointVerdict> verdicts(kCount);
  for (std::size_t i = 0; i < kCount; ++i) {
    points[i].sigma = static_cast<float>(random.uniform(0.05, 2));
    verdicts[i].ray_error_mm = std::abs(random.normal()) * static_cast<double>(points[i].sigma);
  }
  const auto figures = sigma_figures(points, verdicts);
  constexpr double kSampling = 0.015;  // four standard errors of a share of 20000
  constexpr double kSamplingTenth = 0.045;
  EXPECT_NEAR(figures.below_one.value(), 0.6827, kSampling);
  EXPECT_NEAR(figures.below_two.value(), 0.9545, kSampling);
  ASSERT_EQ(figures.tenths.size(), 10U);
  for (const double tenth : figures.tenths) EXPECT_NEAR(tenth, 0.6827, kSamplingTenth);
  EXPECT_GT(figures.rank_correlation, 0.3);
}

TEST(Statistics, RankCorrelationOfMonotoneSeriesIsOne) {
  const std::vector<double> a = {1, 2, 3, 4, 5};
  const std::vector<double> b = {1, 8, 27, 64, 1e9};
  const std::vector<double> c = {5, 4, 3, 2, 1};
  EXPECT_NEAR(rank_correlation(a, b), 1, 1e-12);
  EXPECT_NEAR(rank_correlation(a, c), -1, 1e-12);
}

TEST(Statistics, QuantileInterpolates) {
  EXPECT_DOUBLE_EQ(quantile({4, 1, 2, 3}, 0.5), 2.5);
  EXPECT_DOUBLE_EQ(quantile({0, 10}, 0.9), 9);
  EXPECT_TRUE(std::isnan(quantile({}, 0.5)));
}

}  // namespace
}  // namespace pencilscan
