#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "pencilscan/grid/grid_graph.h"
#include "pencilscan/grid/line_candidates.h"
#include "pencilscan/grid/local_ids.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

/// A camera and two projectors before the plane x = 0, which every projected line crosses.
class PlaneGrid : public testing::Test {
 protected:
  PlaneGrid() {
    rig_ = sample::two_by_two(
        sample::device_at<Camera>({1000, -200, 100}, "cam", 640, 480, 1100),
        sample::device_at<Projector>({900, 450, 90}, "proj0", 640, 512, 1200),
        sample::device_at<Projector>({780, -280, 560}, "proj1", 640, 512, 1200), 110);
    rig_.cameras.resize(1);
    families_ = color_families(rig_);
  }

  /// The curve of one line on the plane within |y|, |z| < 80 mm, with evidence for its colour.
  Curve curve_of(int p, int line, double evidence) const {
    const Projector& projector = rig_.projectors[static_cast<std::size_t>(p)];
    const LinePattern& pattern = projector.patterns.front();
    Curve curve;
    curve.family = p;
    const ColorFamily& family = families_[static_cast<std::size_t>(p)];
    const int color =
        family.color_of_symbol(pattern)[static_cast<std::size_t>(pattern.symbol(line))];
    for (double along = 0; along < 640; along += 1) {
      Vec2 pixel(pattern.position_px(line), along);
      if (pattern.axis == Axis::kRow) pixel = {along, pattern.position_px(line)};
      const Ray ray = projector.ray(pixel);
      const Vec3 x = ray.origin - ray.origin.x() / ray.direction.x() * ray.direction;
      if (x.cwiseAbs().maxCoeff() > 80) continue;
      CurvePoint point;
      point.position = rig_.cameras[0].project(x)->cast<float>();
      point.sigma_px = 0.05F;
      curve.points.push_back(point);
      for (int c = 0; c < 2; ++c)
        curve.code.push_back(c == color ? 0.F : static_cast<float>(-evidence));
    }
    for (std::size_t i = 0; i < curve.points.size(); ++i) {
      const auto& a = curve.points[i > 0 ? i - 1 : 0].position;
      const auto& b = curve.points[std::min(i + 1, curve.points.size() - 1)].position;
      const Eigen::Vector2f t = (b - a).normalized();
      curve.points[i].normal = {t.y(), -t.x()};
    }
    return curve;
  }

  /// All curves of both projectors, and the line of each.
  std::vector<Curve> all_curves(double evidence, std::vector<std::pair<int, int>>& truth) const {
    std::vector<Curve> curves;
    for (int p = 0; p < 2; ++p) {
      const Projector& projector = rig_.projectors[static_cast<std::size_t>(p)];
      for (int line = 0; line < projector.line_count(projector.patterns[0]); ++line) {
        Curve curve = curve_of(p, line, evidence);
        if (curve.points.size() < 20) continue;
        curves.push_back(std::move(curve));
        truth.push_back({p, line});
      }
    }
    return curves;
  }

  Rig rig_;
  std::vector<ColorFamily> families_;
};

TEST_F(PlaneGrid, FindsEveryCrossingAndOneComponent) {
  std::vector<std::pair<int, int>> truth;
  const std::vector<Curve> curves = all_curves(2, truth);
  const GridGraph graph = build_grid_graph(rig_, families_, 0, curves);
  ASSERT_EQ(graph.curves.size(), curves.size());  // nothing cut
  EXPECT_EQ(graph.component_count, 1);
  // The crossing of two lines on the plane is where both light sheets and the plane meet: every
  // crossing must lie on the plane's point of both lines.
  for (const Crossing& x : graph.crossings) {
    const Ray ray = rig_.cameras[0].ray(x.position.cast<double>());
    const Vec3 point = ray.origin - ray.origin.x() / ray.direction.x() * ray.direction;
    for (const int curve : {x.curve_a, x.curve_b}) {
      const auto [p, line] = truth[static_cast<std::size_t>(curve)];
      const Projector& projector = rig_.projectors[static_cast<std::size_t>(p)];
      const LinePattern& pattern = projector.patterns.front();
      const Vec2 pixel = *projector.project(point);
      EXPECT_NEAR(pattern.coordinate(pixel[static_cast<int>(pattern.axis)]), line, 0.01);
    }
  }
}

TEST_F(PlaneGrid, LinesOfOnePatternDoNotCross) {
  const auto middle = [&](int p) {
    const Projector& projector = rig_.projectors[static_cast<std::size_t>(p)];
    return curve_of(p, projector.line_count(projector.patterns[0]) / 2, 2);
  };
  const std::vector<Curve> curves = {middle(0), middle(1)};
  EXPECT_EQ(build_grid_graph(rig_, families_, 0, curves).crossings.size(), 1U);
  // A ghost of the first projector's colour where the second one's line is.
  std::vector<Curve> ghost = curves;
  ghost[1].family = 0;
  EXPECT_TRUE(build_grid_graph(rig_, families_, 0, ghost).crossings.empty());
  // Another projector in this colour could make it a line.
  rig_.projectors[1].patterns[0].colors = rig_.projectors[0].patterns[0].colors;
  families_ = color_families(rig_);
  ASSERT_EQ(families_.size(), 1U);
  EXPECT_EQ(build_grid_graph(rig_, families_, 0, ghost).crossings.size(), 1U);
}

TEST_F(PlaneGrid, LocalIdsFollowFromWeakEvidenceAndNeighbours) {
  std::vector<std::pair<int, int>> truth;
  const std::vector<Curve> curves = all_curves(0.15, truth);
  const GridGraph graph = build_grid_graph(rig_, families_, 0, curves);
  ASSERT_EQ(graph.curves.size(), truth.size());
  std::size_t right = 0;
  for (std::size_t c = 0; c < truth.size(); ++c) {
    ASSERT_TRUE(graph.identities[c].pattern);
    EXPECT_EQ(graph.identities[c].pattern->projector, truth[c].first);
    right += graph.identities[c].local_id == truth[c].second % 8;
  }
  EXPECT_GE(static_cast<double>(right), 0.95 * static_cast<double>(truth.size()));
}

TEST_F(PlaneGrid, CurveThatJumpsToAnotherLineIsCutWhereItsColourFlips) {
  Curve wrong = curve_of(0, 20, 2);  // symbol 0 1: lines 20 and 21 differ in colour
  const Curve next = curve_of(0, 21, 2);
  const LinePattern& pattern = rig_.projectors[0].patterns[0];
  ASSERT_NE(pattern.symbol(20), pattern.symbol(21));
  const std::size_t half = wrong.points.size() / 2;
  for (std::size_t i = half; i < wrong.points.size() && i < next.points.size(); ++i) {
    wrong.points[i] = next.points[i];
    wrong.code[2 * i] = next.code[2 * i];
    wrong.code[2 * i + 1] = next.code[2 * i + 1];
  }
  const auto cuts = color_flips(families_, {wrong}, 8);
  ASSERT_EQ(cuts.size(), 1U);
  EXPECT_NEAR(cuts[0].at, static_cast<double>(half), 2);
}

TEST_F(PlaneGrid, LineOrderAgreesWithTheTrueGradient) {
  const Camera& camera = rig_.cameras[0];
  for (int p = 0; p < 2; ++p) {
    const LinePattern& pattern = rig_.projectors[static_cast<std::size_t>(p)].patterns[0];
    const Curve curve = curve_of(p, 22, 1);
    const CurvePoint& point = curve.points[curve.points.size() / 2];
    const Vec2 pixel = point.position.cast<double>();
    const auto coordinate = [&](const Vec2& at) {
      const Ray ray = camera.ray(at);
      const Vec3 x = ray.origin - ray.origin.x() / ray.direction.x() * ray.direction;
      const Vec2 seen = *rig_.projectors[static_cast<std::size_t>(p)].project(x);
      return pattern.coordinate(seen[static_cast<int>(pattern.axis)]);
    };
    const Vec2 tangent = point.tangent().cast<double>();
    const Vec2 normal(tangent.y(), -tangent.x());
    const double slope = coordinate(pixel + normal) - coordinate(pixel - normal);
    const double depth = (camera.device_from_world * Vec3::Zero()).z();
    EXPECT_EQ(line_order_sign(rig_, camera, {p, 0}, pixel, tangent, depth), slope > 0 ? 1 : -1);
    EXPECT_EQ(line_order_sign(rig_, camera, {p, 0}, pixel, -tangent, depth), slope > 0 ? -1 : 1);
  }
}

TEST_F(PlaneGrid, CandidatesLieOnTheirLightSheetAndInTheVolume) {
  const Vec2 pixel(300, 250);
  const auto range = depth_range(rig_.cameras[0], *rig_.volume, pixel);
  ASSERT_TRUE(range);
  const auto candidates = line_candidates(rig_, rig_.cameras[0], *range, {0, 0}, pixel);
  ASSERT_GT(candidates.size(), 3U);
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const Vec3 x = rig_.cameras[0].point_at_depth(pixel, candidates[i].depth);
    EXPECT_LE((x - rig_.volume->center).norm(), rig_.volume->radius + 1e-6);
    EXPECT_NEAR(rig_.projectors[0].project(x)->x(),
                rig_.projectors[0].patterns[0].position_px(candidates[i].line), 1e-6);
    if (i > 0) {
      EXPECT_GT(candidates[i].depth, candidates[i - 1].depth);
    }
  }
}

TEST(PhaseCosts, AProjectorCostsWhatItLightsLessOfABall) {
  // Devices around z that look at the origin; a patch halfway between two faces both.
  const auto at = [](double degrees) {
    const double angle = degrees * std::numbers::pi / 180;
    return Vec3(1000 * std::cos(angle), 1000 * std::sin(angle), 0);
  };
  Rig rig = sample::two_by_two(sample::device_at<Camera>(at(0), "cam", 640, 480, 1100),
                               sample::device_at<Projector>(at(30), "proj0", 640, 512, 1200),
                               sample::device_at<Projector>(at(90), "proj1", 640, 512, 1200), 110);
  const Projector beside = rig.projectors[0];
  for (const double degrees : {150.0, 180.0}) {
    Projector opposite = sample::device_at<Projector>(at(degrees), "proj", 640, 512, 1200);
    opposite.patterns = beside.patterns;
    rig.projectors.push_back(std::move(opposite));
  }
  rig.projectors[1].patterns = beside.patterns;
  const std::vector<ColorFamily> families = color_families(rig);
  ASSERT_EQ(families.size(), 1U);
  const Camera& camera = rig.cameras[0];
  const std::vector<float> costs = phase_costs(rig, camera, families[0]);
  ASSERT_EQ(costs.size(), 4U);
  EXPECT_EQ(costs[0], 0);
  EXPECT_NEAR(costs[1], 0.62, 0.01);  // log(.933 / .5)
  EXPECT_NEAR(costs[2], 2.63, 0.01);  // log(.933 / .067)
  EXPECT_TRUE(std::isfinite(costs[3]));
  for (const int sees : {0, 1, 2}) EXPECT_TRUE(can_see_pattern(rig, camera, sees)) << sees;
  EXPECT_FALSE(can_see_pattern(rig, camera, 3));
}

}  // namespace
}  // namespace pencilscan
