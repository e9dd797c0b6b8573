#include <gtest/gtest.h>

#include <cmath>

#include "pencilscan/labeling/two_projector_scene.h"
#include "pencilscan/paper/components.h"
#include "pencilscan/paper/pencil_parameter.h"

namespace pencilscan {
namespace {

/// One projector with a grid before the bumpy surface, raised so that both orientations give depth.
class OneGrid : public testing::Test {
 protected:
  OneGrid() {
    // As two projectors at one place with one pattern each, which the scene knows how to draw ...
    for (Projector& projector : scene.rig.projectors)
      projector.device_from_world = look_at({930, 450, 470}, Vec3::Zero());
    // ... and as the one that it is.
    rig = scene.rig;
    rig.projectors[0].patterns.push_back(rig.projectors[1].patterns.front());
    rig.projectors.resize(1);
  }

  GridGraph graph(double half_size_mm, double noise_px, std::uint64_t seed) const {
    GridGraph g = scene.graph(0, half_size_mm, noise_px, seed);
    for (CurveIdentity& identity : g.identities)
      identity.pattern = PatternRef{0, identity.pattern->projector};
    return g;
  }

  double true_mu(const GridGraph& g, int curve) const {
    const auto c = static_cast<std::size_t>(curve);
    return PencilParameter(rig, rig.cameras[0], *g.identities[c].pattern)
        .mu_from_line(scene.true_lines[0][c]);
  }

  double right_share(const GridSolution& solution) const {
    std::size_t right = 0;
    for (std::size_t k = 0; k < solution.curves.size(); ++k)
      right +=
          solution.lines[k] == scene.true_lines[0][static_cast<std::size_t>(solution.curves[k])];
    return static_cast<double>(right) / static_cast<double>(solution.curves.size());
  }

  TwoProjectorScene scene;
  Rig rig;
};

TEST_F(OneGrid, EquationsOfOneProjectorLeaveExactlyOneDegreeOfFreedom) {
  const GridGraph g = graph(80, 0, 1);
  const std::vector<GridSolution> solutions = solve_grids(rig, g);
  ASSERT_EQ(solutions.size(), 1U);
  const GridSolution& grid = solutions.front();
  ASSERT_TRUE(grid.report.solved) << grid.report.reason;
  EXPECT_LT(grid.report.sigma_min, 1e-3 * grid.report.sigma_second);
  // The truth is x0 + s e for some s, wherever x0 lies.
  Eigen::VectorXd off(grid.mu.size());
  for (std::size_t k = 0; k < grid.curves.size(); ++k)
    off[static_cast<Eigen::Index>(k)] =
        true_mu(g, grid.curves[k]) - grid.mu[static_cast<Eigen::Index>(k)];
  const Eigen::VectorXd e = grid.direction.normalized();
  constexpr double kToleranceLines = 0.1;  // crossings lie on chords of 0.5 mm, stored as float
  EXPECT_LT((off - e * e.dot(off)).cwiseAbs().maxCoeff(), kToleranceLines);
}

TEST_F(OneGrid, SearchNamesEveryLineOfALargeGrid) {
  const GridGraph g = graph(80, 0.2, 2);
  const std::vector<GridSolution> solutions = solve_grids(rig, g);
  ASSERT_EQ(solutions.size(), 1U);
  EXPECT_GE(right_share(solutions.front()), 0.99);
  EXPECT_GT(solutions.front().report.margin, 0.5);  // squared lines
}

TEST_F(OneGrid, WithoutIdsNothingTellsThePositionsApart) {
  GridGraph g = graph(80, 0, 4);
  const double margin = solve_grids(rig, g).front().report.margin;
  for (CurveIdentity& identity : g.identities) identity.local_id = -1;
  EXPECT_LT(solve_grids(rig, g).front().report.margin, 0.1 * margin);
}

TEST_F(OneGrid, SolveGivesOrderedRunsOfWholeCurves) {
  const std::vector<GridGraph> graphs = {graph(60, 0.1, 5)};
  const Labeling labeling = solve_projector_grids(rig, graphs);
  ASSERT_EQ(labeling.runs[0].size(), graphs[0].curves.size());
  for (std::size_t k = 0; k < labeling.runs[0].size(); ++k) {
    const LabeledRun& run = labeling.runs[0][k];
    EXPECT_EQ(run.curve, static_cast<int>(k));
    EXPECT_EQ(run.end - run.begin, static_cast<int>(graphs[0].curves[k].points.size()));
    EXPECT_EQ(run.label.line, scene.true_lines[0][k]);
    EXPECT_EQ(run.label.plane, run.label.line);
    EXPECT_GT(run.label.confidence, 0.5F);
  }
  ASSERT_EQ(labeling.components.size(), 1U);
  EXPECT_FALSE(labeling.components[0].sweep_cost.empty());
}

TEST_F(OneGrid, CrossingsOfTwoProjectorsAreNoGrid) {
  const GridGraph g = scene.graph(0, 40, 0, 6);  // the same curves as of two projectors
  EXPECT_TRUE(solve_grids(scene.rig, g).empty());
  EXPECT_FALSE(shows_grid(scene.rig));
  EXPECT_TRUE(shows_grid(rig));
}

}  // namespace
}  // namespace pencilscan
