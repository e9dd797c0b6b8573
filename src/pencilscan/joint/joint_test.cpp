#include "pencilscan/joint/joint.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "pencilscan/core/random.h"
#include "pencilscan/joint/line_sheets.h"
#include "pencilscan/joint/min_sum.h"
#include "pencilscan/joint/piece_labels.h"
#include "pencilscan/labeling/two_projector_scene.h"
#include "pencilscan/pattern/de_bruijn.h"

namespace pencilscan {
namespace {

/// A tree of four nodes with random energies.
PairwiseEnergy random_tree(std::uint64_t seed) {
  Random random(seed);
  PairwiseEnergy energy;
  energy.first = {0, 2, 5, 9, 12};
  for (int i = 0; i < 12; ++i) energy.unary.push_back(static_cast<float>(random.normal(0, 2)));
  for (const auto& [a, b] : {std::pair(0, 1), std::pair(1, 2), std::pair(3, 1)}) {
    energy.edges.push_back({a, b, energy.tables.size()});
    for (int k = 0; k < energy.labels(a) * energy.labels(b); ++k)
      energy.tables.push_back(static_cast<float>(random.normal(0, 2)));
  }
  return energy;
}

float energy_at(const PairwiseEnergy& energy, const std::array<int, 4>& x) {
  float sum = 0;
  for (std::size_t i = 0; i < 4; ++i)
    sum += energy.unary[static_cast<std::size_t>(energy.first[i] + x[i])];
  for (const auto& e : energy.edges) {
    const int a = x[static_cast<std::size_t>(e.a)];
    const int b = x[static_cast<std::size_t>(e.b)];
    sum += energy.tables[e.table + static_cast<std::size_t>(a * energy.labels(e.b) + b)];
  }
  return sum;
}

TEST(MinSum, IsExactOnATree) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const PairwiseEnergy energy = random_tree(seed);
    std::vector<float> marginal(12, 1e9F);
    std::array<int, 4> x{};
    for (x[0] = 0; x[0] < 2; ++x[0])
      for (x[1] = 0; x[1] < 3; ++x[1])
        for (x[2] = 0; x[2] < 4; ++x[2])
          for (x[3] = 0; x[3] < 3; ++x[3]) {
            for (std::size_t i = 0; i < 4; ++i) {
              float& m = marginal[static_cast<std::size_t>(energy.first[i] + x[i])];
              m = std::min(m, energy_at(energy, x));
            }
          }
    const std::vector<float> beliefs = min_sum(energy, 5, 0);
    for (std::size_t i = 0; i < 4; ++i) {
      // Messages are normalised: only differences within a node count.
      for (int k = 1; k < energy.labels(static_cast<int>(i)); ++k) {
        const auto first = static_cast<std::size_t>(energy.first[i]);
        const auto at = first + static_cast<std::size_t>(k);
        EXPECT_NEAR(beliefs[at] - beliefs[first], marginal[at] - marginal[first], 1e-4);
      }
    }
  }
}

/// Two light sheets that meet a plane of the surface, seen by a camera at the origin.
struct LitPlane {
  LabelledPieces pieces;
  std::array<PieceLabel, 2> labels;
  PieceCrossing crossing;

  /// The surface lies at depth 1 / w0 on the axis, with this gradient of inverse depth.
  LitPlane(float w0, const Eigen::Vector2f& gradient, const Eigen::Vector3f& light_a,
           const Eigen::Vector3f& light_b) {
    pieces.inverse_depth_range = 0.5F * w0;
    pieces.lights = {light_a, light_b};
    const Eigen::Vector3f place(0, 0, 1 / w0);
    // A sheet through the light, the place and a direction that is the curve's.
    const std::array<Eigen::Vector2f, 2> tangents = {Eigen::Vector2f(1, 0.2F).normalized(),
                                                     Eigen::Vector2f(-0.1F, 1).normalized()};
    for (std::size_t k = 0; k < 2; ++k) {
      const Eigen::Vector2f t = tangents[k];
      const float w1 = w0 + 0.01F * gradient.dot(t);
      const Eigen::Vector3f next = Eigen::Vector3f(0.01F * t.x(), 0.01F * t.y(), 1) / w1;
      const Eigen::Vector3f n = (place - pieces.lights[k]).cross(next - pieces.lights[k]);
      labels[k].q = n / n.dot(place);
      labels[k].pattern = {static_cast<int>(k), 0};
      labels[k].inverse_depth_per_px = 0.001F * w0;
    }
    crossing.sigma = 1e-4F;
    crossing.along_a = {tangents[0], 0.01F};
    crossing.along_b = {tangents[1], 0.01F};
  }
  [[nodiscard]] float cost() const {
    return CrossingCost(pieces, {})(labels[0], labels[1], crossing);
  }
};

TEST(CrossingCost, AProjectorThatTheSurfaceTurnsAwayFromCannotLightIt) {
  const float none = JointOptions{}.disagreement_cost();
  const Eigen::Vector3f left(-0.6F, 0.1F, 0.2F);
  const Eigen::Vector3f above(0.1F, -0.7F, 0.1F);
  const Eigen::Vector3f behind(0.3F, 0.2F, 2.5F);
  const Eigen::Vector2f frontal(0, 0);
  EXPECT_LT(LitPlane(1, frontal, left, above).cost(), none - 2);
  EXPECT_NEAR(LitPlane(1, frontal, left, behind).cost(), none, 1e-3);
  EXPECT_NEAR(LitPlane(1, frontal, behind, above).cost(), none, 1e-3);
  // Steep, so that the same place turns away from the light at the left.
  EXPECT_NEAR(LitPlane(1, {-2.5F, 0}, left, above).cost(), none, 1e-3);
  EXPECT_LT(LitPlane(1, {2.5F, 0}, left, above).cost(), none - 2);
}

TEST(LineSheets, DepthIsThatOfTheExactLightSheetWithAndWithoutDistortion) {
  for (const double k1 : {0.0, -0.15, 0.6}) {
    TwoProjectorScene scene;
    scene.rig.projectors[1].distortion = {k1, 0.02, 0.001, -0.001, 0};
    if (k1 == 0) scene.rig.projectors[1].distortion = {};
    const Camera& camera = scene.rig.cameras[0];
    const Projector& projector = scene.rig.projectors[1];
    const LinePattern& pattern = projector.patterns.front();
    const LineSheets sheets(scene.rig, camera, {1, 0});
    ASSERT_EQ(sheets.line_count(), projector.line_count(pattern));
    int compared = 0;
    for (const Vec2& pixel : {Vec2(640, 480), Vec2(500, 300), Vec2(800, 600)}) {
      const RayInProjector ray(camera, projector, pixel);
      const Eigen::Vector2f normalized = camera.normalized_from_pixel(pixel).cast<float>();
      for (int line = 0; line < sheets.line_count(); line += 3) {
        const auto depth = ray.depth(pattern.position_px(line), pattern.axis);
        LineSheets::Sheet sheet;
        if (!depth || *depth < 900 || *depth > 1300) continue;
        const Vec2 shown = *projector.project(camera.point_at_depth(pixel, *depth));
        const double along = shown[pattern.axis == Axis::kColumn ? 1 : 0];
        const int extent = pattern.axis == Axis::kColumn ? projector.height : projector.width;
        const bool is_found = sheets.find(line, normalized, 1 / 1300.F, 1 / 900.F, sheet);
        if (std::min(along + 0.5, extent - 0.5 - along) > 1) {
          EXPECT_TRUE(is_found) << line << " " << along;
        }
        if (!is_found) continue;
        ++compared;
        // A tenth of a projector pixel, and the rounding of float.
        const double w = sheet.q.dot(normalized.homogeneous());
        EXPECT_NEAR(w, 1 / *depth, 0.1 * sheet.inverse_depth_per_px + 1e-7);
        EXPECT_NEAR(1 / sheet.inverse_depth_per_px,
                    std::abs(ray.slope(*depth, pattern.axis)) * *depth * *depth,
                    0.02 / sheet.inverse_depth_per_px);
      }
    }
    EXPECT_GT(compared, 20);
  }
}

TEST(PossibleLabels, AStatedFloorFavorsTheLineThatWouldLieOnIt) {
  TwoProjectorScene scene;
  const GridGraph graph = scene.graph(0, 60, 0, 3);
  const Camera& camera = scene.rig.cameras[0];
  const auto labels_of = [&](std::size_t piece, std::vector<Vec3>& points) {
    const LabelledPieces pieces = possible_labels(scene.rig, scene.families, graph, {});
    const Eigen::Vector3f ray = pieces.graph.pieces[piece].middle.homogeneous();
    points.clear();
    for (const PieceLabel& label : pieces.labels[piece])
      points.push_back(camera.device_from_world.inverse() *
                       Vec3(ray.cast<double>() / label.q.dot(ray)));
    return pieces.labels[piece];
  };
  std::vector<std::size_t> open;  // pieces that keep several labels
  const LabelledPieces all = possible_labels(scene.rig, scene.families, graph, {});
  for (std::size_t piece = 0; piece < all.labels.size() && open.size() < 3; ++piece) {
    if (all.labels[piece].size() > 2) open.push_back(piece);
  }
  ASSERT_EQ(open.size(), 3U);
  std::vector<Vec3> points;
  int compared = 0;
  for (const std::size_t piece : open) {
    scene.rig.floor.reset();
    const std::vector<PieceLabel> without = labels_of(piece, points);
    const std::size_t lying = without.size() / 2;
    scene.rig.floor = Floor{points[lying], Vec3(1, 0.2, 0).normalized()};
    const std::vector<PieceLabel> with = labels_of(piece, points);
    for (const PieceLabel& label : with) {
      for (std::size_t k = 0; k < without.size(); ++k) {
        if (!(label.pattern == without[k].pattern) || label.line != without[k].line) continue;
        const float change = label.cost - without[k].cost;
        EXPECT_LE(change, 0);
        if (k == lying) {
          ++compared;
          EXPECT_LT(change, -3);
        } else if (label.pattern == without[lying].pattern) {
          EXPECT_GT(change, -0.01F);
        }
      }
    }
  }
  EXPECT_EQ(compared, 3);
}

class JointScene : public testing::Test, protected TwoProjectorScene {
 protected:
  /// Share of curve points whose label is right, and is wrong.
  std::pair<double, double> shares(const std::vector<GridGraph>& graphs) const {
    const Labeling labeling = solve_joint(rig, families, graphs, {});
    double right = 0;
    double wrong = 0;
    double all = 0;
    for (std::size_t c = 0; c < graphs.size(); ++c) {
      for (const Curve& curve : graphs[c].curves) all += static_cast<double>(curve.points.size());
      for (const LabeledRun& run : labeling.runs[c]) {
        const bool is_right = run.label.line == true_lines[c][static_cast<std::size_t>(run.curve)];
        (is_right ? right : wrong) += run.end - run.begin;
      }
    }
    return {right / all, wrong / all};
  }
};

TEST_F(JointScene, DecidesEveryLineOfTwoViews) {
  const auto [right, wrong] = shares({graph(0, 60, 0.3, 3), graph(1, 60, 0.3, 4)});
  EXPECT_GT(right, 0.97);
  EXPECT_LT(wrong, 0.002);
}

TEST_F(JointScene, NeedsNoColorCode) {
  code_evidence = 0;
  const auto [right, wrong] = shares({graph(0, 60, 0.2, 5), graph(1, 60, 0.2, 6)});
  EXPECT_GT(right, 0.95);
  EXPECT_LT(wrong, 0.005);
}

TEST_F(JointScene, CurveThatJumpsToTheNextLineGetsBothLabels) {
  std::vector<GridGraph> graphs = {graph(0, 60, 0.2, 7), graph(1, 60, 0.2, 8)};
  GridGraph& first = graphs[0];
  // The second half of a long curve of the first projector is replaced by its neighbour's.
  std::size_t k = 0;
  while (first.curves[k].points.size() < 180 || first.curves[k + 1].points.size() < 180) ++k;
  Curve& curve = first.curves[k];
  const Curve& next = first.curves[k + 1];
  const std::size_t middle = 96;
  curve.points.resize(middle);
  curve.code.resize(2 * middle);
  curve.points.insert(curve.points.end(), next.points.begin() + middle, next.points.end());
  curve.code.insert(curve.code.end(), next.code.begin() + 2 * middle, next.code.end());
  first.crossings = find_crossings(first.curves, {1280, 960});
  const Labeling labeling = solve_joint(rig, families, graphs, {});
  const int line = true_lines[0][k];
  int before = 0;
  int after = 0;
  for (const LabeledRun& run : labeling.runs[0]) {
    if (run.curve != static_cast<int>(k)) continue;
    if (run.end <= static_cast<int>(middle) - 12) before += run.label.line == line ? 1 : -100;
    if (run.begin >= static_cast<int>(middle) + 12) after += run.label.line == line + 1 ? 1 : -100;
  }
  EXPECT_GE(before, 2);
  EXPECT_GE(after, 2);
}

TEST_F(JointScene, LoneProjectorIsDecodedFromACodeThatIsUniqueInItsWindow) {
  LinePattern& pattern = rig.projectors[0].patterns.front();
  rig.projectors.resize(1);
  families = color_families(rig);
  const auto alone = [&] {
    std::vector<GridGraph> graphs = {graph(0, 60, 0.2, 9)};
    return shares(graphs);
  };
  // Seven symbols of two colours name one of 128 lines; three name one of eight, which is not
  // enough.
  EXPECT_LT(alone().first + alone().second, 0.02);
  true_lines[0].clear();
  pattern.order = 7;
  pattern.sequence = de_bruijn_sequence(2, 7);
  const auto [right, wrong] = alone();
  EXPECT_GT(right, 0.9);
  EXPECT_LT(wrong, 0.005);
}

}  // namespace
}  // namespace pencilscan
