#include "pencilscan/solution/linear.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pencilscan/core/random.h"
#include "pencilscan/solution/multiview.h"
#include "pencilscan/solution/pencil_parameter.h"
#include "pencilscan/solution/triangulate.h"

namespace pencilscan {
namespace {

/// Two projectors with skew axes and two cameras before a bumpy surface: the paper's minimum, and
/// one more camera for the multi-view solution. Curves are made from geometry alone, without
/// images.
class TwoProjectorScene : public testing::Test {
 protected:
  TwoProjectorScene() {
    for (int c = 0; c < 2; ++c) {
      Camera camera;
      camera.name = "cam" + std::to_string(c);
      camera.width = 1280;
      camera.height = 960;
      camera.K << 2300, 0, 640, 0, 2300, 480, 0, 0, 1;
      camera.device_from_world = look_at({1100, c == 0 ? -250.0 : 250.0, 150}, Vec3::Zero());
      rig_.cameras.push_back(camera);
    }
    for (int p = 0; p < 2; ++p) {
      Projector projector;
      projector.name = "proj" + std::to_string(p);
      projector.width = 1280;
      projector.height = 1024;
      projector.K << 2400, 0, 640, 0, 2400, 512, 0, 0, 1;
      projector.device_from_world = p == 0 ? look_at({1000, 500, 100}, Vec3::Zero())
                                           : look_at({857, -312, 615}, Vec3::Zero());
      LinePattern pattern;
      pattern.axis = p == 0 ? Axis::kColumn : Axis::kRow;
      if (p == 1) pattern.colors = {"red", "yellow"};
      projector.patterns = {pattern};
      rig_.projectors.push_back(projector);
    }
    rig_.volume = Sphere{Vec3::Zero(), 150};
  }

  /// World point of the surface x = bump(y, z).
  static Vec3 surface(double y, double z) {
    return {20 * std::cos(y / 25) * std::cos(z / 30) - y * y / 400 - z * z / 500, y, z};
  }

  /// Curves of one camera: for every line, points where the surface has that line coordinate.
  GridGraph graph(int camera, double half_size_mm, double noise_px, std::uint64_t seed) const {
    GridGraph graph;
    graph.camera = camera;
    Random random(seed);
    for (int p = 0; p < 2; ++p) {
      const Projector& projector = rig_.projectors[static_cast<std::size_t>(p)];
      const LinePattern& pattern = projector.patterns.front();
      const auto axis = static_cast<Eigen::Index>(pattern.axis);
      for (int line = 0; line < projector.line_count(pattern); ++line) {
        Curve curve;
        curve.family = p;
        for (double t = -half_size_mm; t <= half_size_mm; t += 0.5) {
          // Along the line's direction t is fixed, across it the root is found by bisection.
          const auto coordinate = [&](double w) {
            const Vec3 x = p == 0 ? surface(w, t) : surface(t, w);
            return (*projector.project(x))[axis] - pattern.position_px(line);
          };
          double low = -half_size_mm;
          double high = half_size_mm;
          if ((coordinate(low) < 0) == (coordinate(high) < 0)) continue;
          for (int k = 0; k < 50; ++k) {
            const double middle = 0.5 * (low + high);
            ((coordinate(middle) < 0) == (coordinate(low) < 0) ? low : high) = middle;
          }
          const Vec3 x = p == 0 ? surface(low, t) : surface(t, low);
          CurvePoint point;
          point.position = rig_.cameras[static_cast<std::size_t>(camera)].project(x)->cast<float>();
          point.position.x() += static_cast<float>(random.normal(0, noise_px));
          point.position.y() += static_cast<float>(random.normal(0, noise_px));
          point.sigma_px = 0.05F;
          curve.points.push_back(point);
        }
        if (curve.points.size() < 8) continue;
        graph.curves.push_back(curve);
        graph.identities.push_back({PatternRef{p, 0}, 0, pattern.local_id(line), 1});
        true_lines_[static_cast<std::size_t>(camera)].push_back(line);
      }
    }
    graph.crossings = find_crossings(graph.curves, {1280, 960});
    graph.component_of_curve.assign(graph.curves.size(), 0);
    graph.component_count = 1;
    return graph;
  }

  Rig rig_;
  mutable std::vector<int> true_lines_[2];
};

TEST_F(TwoProjectorScene, LinearFindsThePlanesOfNoiseFreeCrossings) {
  const GridGraph g = graph(0, 90, 0, 1);
  ASSERT_GT(g.crossings.size(), 200U);
  const LinearSolution solution = solve_component(rig_, g, 0);
  ASSERT_TRUE(solution.solved) << solution.reason;
  for (std::size_t k = 0; k < solution.curves.size(); ++k) {
    const auto curve = static_cast<std::size_t>(solution.curves[k]);
    const PencilParameter parameter(rig_, rig_.cameras[0], *g.identities[curve].pattern);
    // Positions are stored as float, and crossings lie on chords of 0.5 mm: a few thousandths of a
    // pixel, which the weak direction of equation (6) amplifies.
    constexpr double kToleranceLines = 0.3;
    EXPECT_NEAR(parameter.line_from_mu(solution.mu[static_cast<Eigen::Index>(k)]),
                true_lines_[0][curve], kToleranceLines);
  }
  EXPECT_LT(solution.residual_rms_px, 0.05);
}

TEST_F(TwoProjectorScene, ErrorOfTheLinearSolutionLiesAlongItsWeakestDirection) {
  const GridGraph g = graph(0, 45, 0.2, 2);
  const LinearSolution solution = solve_component(rig_, g, 0);
  ASSERT_TRUE(solution.solved);
  EXPECT_LT(solution.sigma_min, 0.2 * solution.sigma_second);  // nearly one degree of freedom
  Eigen::VectorXd error(solution.mu.size());
  for (std::size_t k = 0; k < solution.curves.size(); ++k) {
    const auto curve = static_cast<std::size_t>(solution.curves[k]);
    const PencilParameter parameter(rig_, rig_.cameras[0], *g.identities[curve].pattern);
    error[static_cast<Eigen::Index>(k)] =
        solution.mu[static_cast<Eigen::Index>(k)] - parameter.mu_from_line(true_lines_[0][curve]);
  }
  const double along = error.dot(solution.direction.normalized());
  // The paper's section IV-B: "the distribution of the error can be explained by 1-DOF".
  EXPECT_GT(along * along, 0.8 * error.squaredNorm());
}

TEST_F(TwoProjectorScene, MultiviewFindsEveryLineWhereLinearMisses) {
  const std::vector<GridGraph> graphs = {graph(0, 60, 0.3, 3), graph(1, 60, 0.3, 4)};
  SolutionOptions options;
  options.method = Method::kMultiview;
  const Labeling labeling = solve(rig_, graphs, options);
  for (std::size_t c = 0; c < 2; ++c) {
    std::size_t right = 0;
    for (std::size_t k = 0; k < graphs[c].curves.size(); ++k) {
      right += labeling.labels[c][k] && labeling.labels[c][k]->line == true_lines_[c][k];
    }
    EXPECT_GE(static_cast<double>(right), 0.95 * static_cast<double>(graphs[c].curves.size()));
  }
  for (const ComponentReport& report : labeling.components) EXPECT_GT(report.margin, 0);
}

TEST_F(TwoProjectorScene, TriangulatedPointsLieOnTheSurface) {
  const std::vector<GridGraph> graphs = {graph(0, 60, 0, 5)};
  Labeling labeling;
  labeling.labels.resize(2);
  for (const int line : true_lines_[0]) {
    const std::size_t k = labeling.labels[0].size();
    labeling.labels[0].push_back(
        CurveLabel{*graphs[0].identities[k].pattern, line, static_cast<double>(line), 1});
  }
  const std::vector<MeasuredPoint> points = triangulate(rig_, graphs, labeling);
  ASSERT_GT(points.size(), 1000U);
  for (const MeasuredPoint& p : points) {
    EXPECT_NEAR(p.x, surface(p.y, p.z).x(), 0.05);  // mm; float pixels are good to 1e-4 px
    EXPECT_GT(p.sigma, 0);
  }
}

TEST(NearestLine, KeepsTheLocalIdAndThePanel) {
  EXPECT_EQ(nearest_line(17.4, 1, 8, 100), 17);
  EXPECT_EQ(nearest_line(12.9, 1, 8, 100), 9);
  EXPECT_EQ(nearest_line(13.1, 1, 8, 100), 17);
  EXPECT_EQ(nearest_line(-50, 3, 8, 100), 3);
  EXPECT_EQ(nearest_line(500, 3, 8, 100), 99);
  EXPECT_EQ(nearest_line(41.6, -1, 8, 100), 42);
}

}  // namespace
}  // namespace pencilscan
