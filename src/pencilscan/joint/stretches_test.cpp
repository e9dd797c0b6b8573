#include "pencilscan/joint/stretches.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "pencilscan/core/random.h"

namespace pencilscan {
namespace {

constexpr int kLines = 5;

/// Three curves of five, three and four pieces with random labels, costs and links between pieces,
/// and decisions that give each curve one or two lines.
struct Scene {
  explicit Scene(Random& random) {
    for (const int count : {5, 3, 4}) {
      const int curve = next_curve++;
      for (int k = 0; k < count; ++k) {
        CurvePiece piece;
        piece.curve = curve;
        piece.begin = 10 * k;
        piece.end = 10 * (k + 1);
        pieces.graph.pieces.push_back(piece);
        std::vector<PieceLabel> labels;
        for (int line = 0; line < kLines; ++line) {
          if (line != curve && random.below(4) == 0) continue;
          PieceLabel label;
          label.pattern = {0, 0};
          label.line = line;
          labels.push_back(label);
        }
        pieces.labels.push_back(labels);
      }
    }
    energy.first.push_back(0);
    for (const auto& labels : pieces.labels) {
      for (std::size_t k = 0; k < labels.size(); ++k)
        energy.unary.push_back(static_cast<float>(random.uniform(-1, 3)));
      energy.unary.push_back(0);
      energy.first.push_back(static_cast<int>(energy.unary.size()));
    }
    const auto count = static_cast<std::uint32_t>(pieces.labels.size());
    for (int e = 0; e < 20; ++e) {
      const int a = static_cast<int>(random.below(count));
      const int b = static_cast<int>(random.below(count));
      if (a == b) continue;
      energy.edges.push_back({a, b, energy.tables.size()});
      const int size = energy.labels(a) * energy.labels(b);
      for (int k = 0; k < size; ++k)
        energy.tables.push_back(static_cast<float>(random.uniform(-2, 2)));
    }
    // Line = curve; the third piece of the first curve is an outlier and parts it in two.
    for (std::size_t p = 0; p < pieces.labels.size(); ++p) {
      decisions.push_back({index_of(p, pieces.graph.pieces[p].curve), 5.F});
    }
    decisions[2].label = -1;
  }

  /// Of this line among the labels of a piece; -1: it has none.
  [[nodiscard]] int index_of(std::size_t p, int line) const {
    const auto& labels = pieces.labels[p];
    const auto found = std::find_if(labels.begin(), labels.end(),
                                    [&](const PieceLabel& l) { return l.line == line; });
    return found == labels.end() ? -1 : static_cast<int>(found - labels.begin());
  }

  /// Cost of all pieces with these lines, outliers where they have none; -1: left out.
  [[nodiscard]] float cost(const std::vector<int>& line_of_piece) const {
    const auto label = [&](int p) {
      const auto k = static_cast<std::size_t>(p);
      const int index = index_of(k, line_of_piece[k]);
      return index < 0 ? static_cast<int>(pieces.labels[k].size()) : index;
    };
    float sum = 0;
    for (int p = 0; p < energy.nodes(); ++p) {
      if (line_of_piece[static_cast<std::size_t>(p)] < 0) continue;
      sum += energy.unary[static_cast<std::size_t>(energy.first[static_cast<std::size_t>(p)] +
                                                   label(p))];
    }
    for (const PairwiseEnergy::Edge& edge : energy.edges) {
      if (line_of_piece[static_cast<std::size_t>(edge.a)] < 0 ||
          line_of_piece[static_cast<std::size_t>(edge.b)] < 0)
        continue;
      sum += energy.tables[edge.table + static_cast<std::size_t>(
                                            label(edge.a) * energy.labels(edge.b) + label(edge.b))];
    }
    return sum;
  }

  int next_curve = 0;
  LabelledPieces pieces;
  PairwiseEnergy energy;
  std::vector<Decision> decisions;
};

float cost_of(const PairwiseEnergy& energy, const std::vector<int>& x) {
  float sum = 0;
  for (std::size_t i = 0; i < x.size(); ++i)
    sum += energy.unary[static_cast<std::size_t>(energy.first[i] + x[i])];
  for (const PairwiseEnergy::Edge& edge : energy.edges) {
    const auto a = static_cast<std::size_t>(edge.a);
    const auto b = static_cast<std::size_t>(edge.b);
    sum +=
        energy.tables[edge.table + static_cast<std::size_t>(x[a] * energy.labels(edge.b) + x[b])];
  }
  return sum;
}

/// Calls visit with every choice of a label per variable.
template <class Visit>
void for_each_choice(const PairwiseEnergy& energy, Visit visit) {
  std::vector<int> x(static_cast<std::size_t>(energy.nodes()), 0);
  while (true) {
    visit(x);
    std::size_t i = 0;
    while (i < x.size() && ++x[i] == energy.labels(static_cast<int>(i))) x[i++] = 0;
    if (i == x.size()) return;
  }
}

TEST(Stretches, ArePiecesOfOneCurveWithOneLine) {
  Random random(3);
  const Scene scene(random);
  const std::vector<Stretch> stretches = same_line_stretches(scene.pieces, scene.decisions);
  ASSERT_EQ(stretches.size(), 4U);
  const std::size_t expected[4][2] = {{0, 1}, {3, 4}, {5, 7}, {8, 11}};
  for (std::size_t s = 0; s < 4; ++s) {
    EXPECT_EQ(stretches[s].first, expected[s][0]);
    EXPECT_EQ(stretches[s].last, expected[s][1]);
  }
}

TEST(Stretches, TiedCostTheSumOfTheirPieces) {
  Random random(4);
  for (int k = 0; k < 8; ++k) {
    const Scene scene(random);
    const std::vector<Stretch> stretches = same_line_stretches(scene.pieces, scene.decisions);
    const TiedEnergy tied = tie_pieces(scene.pieces, scene.energy, stretches);
    ASSERT_EQ(tied.lines.size(), stretches.size());
    int choices = 0;
    for_each_choice(tied.energy, [&](const std::vector<int>& x) {
      std::vector<int> line_of_piece(scene.pieces.labels.size(), -1);
      for (std::size_t s = 0; s < x.size(); ++s) {
        for (std::size_t p = stretches[s].first; p <= stretches[s].last; ++p)
          line_of_piece[p] = tied.lines[s][static_cast<std::size_t>(x[s])].line;
      }
      ASSERT_NEAR(cost_of(tied.energy, x), scene.cost(line_of_piece), 1e-4);
      ++choices;
    });
    EXPECT_GT(choices, 100);
  }
}

TEST(Stretches, MarginIsWhatTheBestOtherLineCostsMore) {
  Random random(5);
  int preferred = 0;
  int denied = 0;
  for (int k = 0; k < 60; ++k) {
    Scene scene(random);
    // One chain of stretches, for which messages are exact.
    std::erase_if(scene.energy.edges, [&](const PairwiseEnergy::Edge& edge) {
      const int a = scene.pieces.graph.pieces[static_cast<std::size_t>(edge.a)].curve;
      const int b = scene.pieces.graph.pieces[static_cast<std::size_t>(edge.b)].curve;
      return std::abs(a - b) != 1 || edge.a < 2 || edge.b < 2;
    });
    const std::vector<float> margins =
        margins_of_stretches(scene.pieces, scene.energy, scene.decisions, 200, 0.3F);
    const std::vector<Stretch> stretches = same_line_stretches(scene.pieces, scene.decisions);
    const TiedEnergy tied = tie_pieces(scene.pieces, scene.energy, stretches);
    for (std::size_t s = 0; s < stretches.size(); ++s) {
      const int line = scene.pieces.graph.pieces[stretches[s].first].curve;
      float own = std::numeric_limits<float>::max();
      float other = own;
      for_each_choice(tied.energy, [&](const std::vector<int>& x) {
        float& least = tied.lines[s][static_cast<std::size_t>(x[s])].line == line ? own : other;
        least = std::min(least, cost_of(tied.energy, x));
      });
      const float expected = std::max(0.F, other - own);
      for (std::size_t p = stretches[s].first; p <= stretches[s].last; ++p)
        EXPECT_NEAR(margins[p], expected, 1e-3);
      ++(expected > 0 ? preferred : denied);
    }
    EXPECT_EQ(margins[2], 0);  // an outlier
  }
  EXPECT_GT(preferred, 10);
  EXPECT_GT(denied, 10);
}

TEST(Stretches, AreFaintBesideALineThatIsThreeTimesAsBright) {
  Random random(6);
  const Scene scene(random);
  GridGraph graph;
  for (const float height : {1.F, 0.25F, 0.5F}) {
    Curve curve;
    curve.points.resize(50);
    for (CurvePoint& point : curve.points) point.amplitude = height;
    graph.curves.push_back(curve);
  }
  // Two of three pieces of the second curve lie beside the first, and its last beside the third,
  // which is no brighter than twice as much; the third lies beside the first with one of four.
  std::vector<NextPiece> beside(4);
  const int ends[4][2] = {{0, 5}, {6, 3}, {7, 8}, {4, 11}};
  for (std::size_t k = 0; k < 4; ++k) {
    beside[k].a = ends[k][0];
    beside[k].b = ends[k][1];
  }
  std::vector<char> expected(12, 0);
  expected[5] = expected[6] = expected[7] = 1;
  EXPECT_EQ(faint_pieces(graph, scene.pieces, beside, scene.decisions), expected);
  // The outlier is judged by itself.
  for (CurvePoint& point : graph.curves[0].points) point.amplitude = 0.1F;
  beside[0] = {2, 5};
  const std::vector<char> faint = faint_pieces(graph, scene.pieces, beside, scene.decisions);
  EXPECT_EQ(faint[2], 0);
  beside[0] = {2, 9};
  EXPECT_EQ(faint_pieces(graph, scene.pieces, beside, scene.decisions)[2], 1);
}

/// One curve of two pieces that may be lines 1, 2 and 9 of a code of eight; it was named 1.
struct Periodic {
  Periodic() {
    rig.projectors.emplace_back();
    rig.projectors[0].patterns.emplace_back();
    for (int k = 0; k < 2; ++k) {
      CurvePiece piece;
      piece.begin = 10 * k;
      piece.end = 10 * (k + 1);
      pieces.graph.pieces.push_back(piece);
      auto& labels = pieces.labels.emplace_back();
      for (const int line : {1, 2, 9}) {
        labels.emplace_back();
        labels.back().pattern = {0, 0};
        labels.back().line = line;
      }
      decisions.push_back({0, 5.F});
    }
    energy.first = {0, 4, 8};
    energy.unary.assign(8, 0.F);
  }

  Rig rig;
  LabelledPieces pieces;
  PairwiseEnergy energy;
  std::vector<Decision> decisions;
};

TEST(LeavePeriodic, OnlyOtherViewsTellALineFromOneAPeriodAway) {
  Periodic scene;
  auto decisions = scene.decisions;
  leave_periodic(scene.rig, scene.pieces, scene.energy, decisions);
  for (const Decision& d : decisions) EXPECT_EQ(d.margin, 0);

  scene.energy.unary = {-1, 0, 2, 0, -1, 0, 0.5F, 0};  // lines 1, 2, 9 and none, twice
  decisions = scene.decisions;
  leave_periodic(scene.rig, scene.pieces, scene.energy, decisions);
  for (const Decision& d : decisions) EXPECT_FLOAT_EQ(d.margin, 4.5F);

  std::swap(scene.energy.unary[0], scene.energy.unary[2]);  // the first piece is rather line 9
  decisions = scene.decisions;
  leave_periodic(scene.rig, scene.pieces, scene.energy, decisions);
  for (const Decision& d : decisions) EXPECT_EQ(d.margin, 0);
}

TEST(LeavePeriodic, ALineThatOnePieceCannotBeIsNoQuestion) {
  Periodic scene;
  scene.pieces.labels[1].pop_back();
  scene.energy.first = {0, 4, 7};
  auto decisions = scene.decisions;
  leave_periodic(scene.rig, scene.pieces, scene.energy, decisions);
  for (const Decision& d : decisions) EXPECT_EQ(d.margin, 5);
}

}  // namespace
}  // namespace pencilscan
