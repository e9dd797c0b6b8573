#include "pencilscan/paper/linear.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pencilscan/labeling/two_projector_scene.h"
#include "pencilscan/paper/components.h"
#include "pencilscan/paper/pencil_parameter.h"
#include "pencilscan/points/triangulate.h"

namespace pencilscan {
namespace {

class TwoProjectors : public testing::Test, protected TwoProjectorScene {};

TEST_F(TwoProjectors, LinearFindsThePlanesOfNoiseFreeCrossings) {
  const GridGraph g = graph(0, 90, 0, 1);
  ASSERT_GT(g.crossings.size(), 200U);
  const LinearSolution solution = solve_component(rig, g, 0);
  ASSERT_TRUE(solution.solved) << solution.reason;
  for (std::size_t k = 0; k < solution.curves.size(); ++k) {
    const auto curve = static_cast<std::size_t>(solution.curves[k]);
    const PencilParameter parameter(rig, rig.cameras[0], *g.identities[curve].pattern);
    // Positions are stored as float, and crossings lie on chords of 0.5 mm: a few thousandths of a
    // pixel, which the weak direction of equation (6) amplifies.
    constexpr double kToleranceLines = 0.3;
    EXPECT_NEAR(parameter.line_from_mu(solution.mu[static_cast<Eigen::Index>(k)]),
                true_lines[0][curve], kToleranceLines);
  }
  EXPECT_LT(solution.residual_rms_px, 0.05);
}

TEST_F(TwoProjectors, ErrorOfTheLinearSolutionLiesAlongItsWeakestDirection) {
  const GridGraph g = graph(0, 45, 0.2, 2);
  const LinearSolution solution = solve_component(rig, g, 0);
  ASSERT_TRUE(solution.solved);
  EXPECT_LT(solution.sigma_min, 0.2 * solution.sigma_second);  // nearly one degree of freedom
  Eigen::VectorXd error(solution.mu.size());
  for (std::size_t k = 0; k < solution.curves.size(); ++k) {
    const auto curve = static_cast<std::size_t>(solution.curves[k]);
    const PencilParameter parameter(rig, rig.cameras[0], *g.identities[curve].pattern);
    error[static_cast<Eigen::Index>(k)] =
        solution.mu[static_cast<Eigen::Index>(k)] - parameter.mu_from_line(true_lines[0][curve]);
  }
  const double along = error.dot(solution.direction.normalized());
  // The paper's section IV-B: "the distribution of the error can be explained by 1-DOF".
  EXPECT_GT(along * along, 0.8 * error.squaredNorm());
}

TEST_F(TwoProjectors, MultiviewFindsEveryLineWhereLinearMisses) {
  const std::vector<GridGraph> graphs = {graph(0, 60, 0.3, 3), graph(1, 60, 0.3, 4)};
  const Labeling labeling = solve_multiview(rig, graphs);
  for (std::size_t c = 0; c < 2; ++c) {
    std::size_t right = 0;
    for (const LabeledRun& run : labeling.runs[c])
      right += run.label.line == true_lines[c][static_cast<std::size_t>(run.curve)];
    EXPECT_GE(static_cast<double>(right), 0.95 * static_cast<double>(graphs[c].curves.size()));
  }
  for (const ComponentReport& report : labeling.components) EXPECT_GT(report.margin, 0);
}

TEST_F(TwoProjectors, WhatLiesNowhereInTheVolumeHasNoLines) {
  const std::vector<GridGraph> graphs = {graph(0, 60, 0.3, 3), graph(1, 60, 0.3, 4)};
  rig.volume->center += Vec3(0, 0, 50 * rig.volume->radius);
  for (const MultiviewCost cost : {MultiviewCost::kNormalized, MultiviewCost::kPublished}) {
    MultiviewOptions options;
    options.cost = cost;
    const Labeling labeling = solve_multiview(rig, graphs, options);
    for (const auto& runs : labeling.runs) EXPECT_TRUE(runs.empty());
    for (const ComponentReport& report : labeling.components) EXPECT_FALSE(report.reason.empty());
  }
}

TEST_F(TwoProjectors, TriangulatedPointsLieOnTheSurface) {
  const std::vector<GridGraph> graphs = {graph(0, 60, 0, 5)};
  Labeling labeling;
  labeling.runs.resize(2);
  for (std::size_t k = 0; k < true_lines[0].size(); ++k) {
    const int line = true_lines[0][k];
    labeling.runs[0].push_back(
        {static_cast<int>(k), 0, static_cast<int>(graphs[0].curves[k].points.size()),
         CurveLabel{*graphs[0].identities[k].pattern, line, static_cast<double>(line), 1}});
  }
  const std::vector<MeasuredPoint> points = triangulate(rig, graphs, labeling);
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
