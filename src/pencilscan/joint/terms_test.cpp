// Terms of the energy against plain loops over all pieces, points and labels.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <utility>
#include <vector>

#include "pencilscan/core/random.h"
#include "pencilscan/joint/next_lines.h"
#include "pencilscan/joint/other_views.h"
#include "pencilscan/joint/surroundings.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

const CurvePoint& point_of(const GridGraph& graph, const CurvePiece& piece, int i) {
  return graph.curves[static_cast<std::size_t>(piece.curve)].points[static_cast<std::size_t>(i)];
}

const Curve& curve_of(const GridGraph& graph, const CurvePiece& piece) {
  return graph.curves[static_cast<std::size_t>(piece.curve)];
}

/// Bent curves anywhere in the image of a small camera, most of them side by side, a point per
/// pixel.
GridGraph random_curves(const Camera& camera, int count, Random& random) {
  GridGraph graph;
  for (int k = 0; k < count; ++k) {
    Curve curve;
    curve.family = static_cast<int>(random.below(2));
    Eigen::Vector2d at(random.uniform(0, camera.width), random.uniform(0, camera.height));
    double angle = random.below(5) == 0 ? random.uniform(0, 6.28) : random.uniform(-0.4, 0.4);
    const double bend = random.uniform(-0.01, 0.01);
    const std::uint32_t length = 8 + random.below(60);
    for (std::uint32_t i = 0; i < length && camera.contains(at); ++i) {
      CurvePoint point;
      point.position = at.cast<float>();
      point.normal = Eigen::Vector2d(std::sin(angle), -std::cos(angle)).cast<float>();
      point.sigma_px = 0.05F;
      curve.points.push_back(point);
      at += random.uniform(0.8, 1.2) * Eigen::Vector2d(std::cos(angle), std::sin(angle));
      angle += bend;
    }
    if (curve.points.size() >= 4) graph.curves.push_back(curve);
  }
  return graph;
}

void add_random_crossings(std::size_t count, PieceGraph& graph, Random& random) {
  const auto pieces = static_cast<std::uint32_t>(graph.pieces.size());
  for (std::size_t i = 0; i < count; ++i) {
    PieceCrossing crossing;
    crossing.a = static_cast<int>(random.below(pieces));
    crossing.b = static_cast<int>(random.below(pieces));
    graph.crossings.push_back(crossing);
  }
}

/// Beliefs that sum to at most one; some labels have next to none.
PieceBeliefs random_beliefs(const LabelledPieces& pieces, Random& random) {
  PieceBeliefs beliefs;
  for (const auto& labels : pieces.labels) {
    std::vector<float> of_piece;
    double left = 1;
    for (std::size_t k = 0; k < labels.size(); ++k) {
      const double belief = left * (random.below(3) == 0 ? 0.001 : random.uniform());
      of_piece.push_back(static_cast<float>(belief));
      left -= belief;
    }
    beliefs.push_back(of_piece);
  }
  return beliefs;
}

/// Surroundings: the nearest six of the pieces of other curves within 16 px of a piece's middle
/// that do not cross it, by every second point. A label's likelihood is a Cauchy distribution of
/// slopes, against slopes at random: those that the volume's depth allows.
std::vector<std::vector<double>> plain_surroundings(const Camera& camera, const GridGraph& graph,
                                                    const LabelledPieces& all,
                                                    const PieceBeliefs& beliefs,
                                                    std::size_t& most_around) {
  const auto& list = all.graph.pieces;
  std::vector<std::vector<double>> costs;
  for (std::size_t p = 0; p < list.size(); ++p) {
    const Eigen::Vector2f middle =
        point_of(graph, list[p], (list[p].begin + list[p].end) / 2).position;
    std::vector<std::pair<float, std::size_t>> around;
    std::vector<Eigen::Vector2f> nearest(list.size());
    for (std::size_t o = 0; o < list.size(); ++o) {
      const bool crosses =
          std::any_of(all.graph.crossings.begin(), all.graph.crossings.end(), [&](const auto& x) {
            return std::minmax(x.a, x.b) == std::minmax(static_cast<int>(p), static_cast<int>(o));
          });
      if (list[o].curve == list[p].curve || crosses) continue;
      float best = 1e9F;
      for (int i = list[o].begin; i < list[o].end; i += 2) {
        const Eigen::Vector2f& x = point_of(graph, list[o], i).position;
        if ((x - middle).norm() >= best) continue;
        best = (x - middle).norm();
        nearest[o] = x;
      }
      if (best <= 16) around.emplace_back(best, o);
    }
    most_around = std::max(most_around, around.size());
    std::sort(around.begin(), around.end());
    if (around.size() > 6) around.resize(6);
    costs.emplace_back(all.labels[p].size(), 0.0);
    const Eigen::Vector3d here = list[p].middle.cast<double>().homogeneous();
    for (const auto& [px, o] : around) {
      const Eigen::Vector3d there =
          camera.normalized_from_pixel(nearest[o].cast<double>()).homogeneous();
      for (std::size_t k = 0; k < all.labels[p].size(); ++k) {
        const double w = all.labels[p][k].q.cast<double>().dot(here);
        const double sideways = w * (here - there).norm();
        double likelihood = 0;
        double known = 0;
        for (std::size_t j = 0; j < all.labels[o].size(); ++j) {
          const auto belief = static_cast<double>(beliefs[o][j]);
          if (belief < 0.01) continue;
          known += belief;
          const double slope = (all.labels[o][j].q.cast<double>().dot(there) - w) / sideways;
          likelihood += belief / (std::numbers::pi * (1 + slope * slope));
        }
        const double at_random = sideways / static_cast<double>(all.inverse_depth_range);
        const double ratio = likelihood / at_random + 1 - known;
        costs[p][k] -=
            2 / std::max(2.0, static_cast<double>(around.size())) * std::log(std::max(0.05, ratio));
      }
    }
  }
  return costs;
}

TEST(Surroundings, CostIsThatOfAPlainLoopOverAllPieces) {
  const Camera camera = sample::device_at<Camera>({560, -110, 80}, "cam0", 100, 90, 400);
  Random random(1);
  std::size_t most_around = 0;
  double largest = 0;
  for (int scene = 0; scene < 3; ++scene) {
    const GridGraph graph = random_curves(camera, 40, random);
    LabelledPieces pieces;
    pieces.graph = cut_into_pieces(camera, graph, 12);
    add_random_crossings(200, pieces.graph, random);
    pieces.inverse_depth_range = 5e-4F;
    for (std::size_t p = 0; p < pieces.graph.pieces.size(); ++p) {
      pieces.labels.emplace_back(random.below(4));
      for (PieceLabel& label : pieces.labels.back()) {
        label.q = {static_cast<float>(random.uniform(-3e-4, 3e-4)),
                   static_cast<float>(random.uniform(-3e-4, 3e-4)),
                   static_cast<float>(random.uniform(1.6e-3, 1.9e-3))};
      }
    }
    const Surroundings surroundings(camera, graph, pieces);
    const PieceBeliefs beliefs = random_beliefs(pieces, random);
    const auto costs = surroundings.costs(beliefs);
    const auto expected = plain_surroundings(camera, graph, pieces, beliefs, most_around);
    ASSERT_EQ(costs.size(), expected.size());
    for (std::size_t p = 0; p < costs.size(); ++p) {
      ASSERT_EQ(costs[p].size(), expected[p].size());
      for (std::size_t k = 0; k < costs[p].size(); ++k) {
        EXPECT_NEAR(costs[p][k], expected[p][k], 1e-3) << p << " " << k;
        largest = std::max(largest, std::abs(expected[p][k]));
      }
    }
    for (const auto& of_piece : surroundings.costs({})) {
      EXPECT_EQ(std::count(of_piece.begin(), of_piece.end(), 0.F),
                static_cast<std::ptrdiff_t>(of_piece.size()));
    }
  }
  EXPECT_GT(most_around, 6U);  // more than count
  EXPECT_GT(largest, 1);
}

/// The nearest piece on one side as next_lines.h defines it; -1: none.
int plain_next(const GridGraph& graph, const PieceGraph& pieces, std::size_t p, float side) {
  const CurvePiece& own = pieces.pieces[p];
  const CurvePoint& middle = point_of(graph, own, (own.begin + own.end) / 2);
  const Eigen::Vector2f tangent = middle.tangent();
  const Eigen::Vector2f normal(tangent.y(), -tangent.x());
  float nearest = 48;
  int found = -1;
  for (std::size_t o = 0; o < pieces.pieces.size(); ++o) {
    const CurvePiece& other = pieces.pieces[o];
    if (other.curve == own.curve || curve_of(graph, other).family != curve_of(graph, own).family)
      continue;
    for (int i = other.begin; i < other.end; ++i) {
      const CurvePoint& point = point_of(graph, other, i);
      const Eigen::Vector2f way = point.position - middle.position;
      const float across = side * way.dot(normal);
      const bool is_beside = across >= 1.5F && std::abs(way.dot(tangent)) <= 1;
      const bool runs_along = std::abs(point.tangent().dot(tangent)) >= 0.85F;
      if (!is_beside || !runs_along || across >= nearest) continue;
      nearest = across;
      found = static_cast<int>(o);
    }
  }
  return found;
}

TEST(NextPieces, AreThoseOfAPlainLoopOverAllPoints) {
  const Camera camera = sample::device_at<Camera>({560, -110, 80}, "cam0", 160, 130, 400);
  Random random(2);
  std::size_t found = 0;
  for (int scene = 0; scene < 4; ++scene) {
    const GridGraph graph = random_curves(camera, 30, random);
    PieceGraph pieces = cut_into_pieces(camera, graph, 14);
    add_random_crossings(6, pieces, random);
    std::set<int> crossed;
    for (const PieceCrossing& x : pieces.crossings) crossed.insert({x.a, x.b});
    std::vector<NextPiece> expected;
    std::set<std::pair<int, int>> seen;
    for (std::size_t p = 0; p < pieces.pieces.size(); ++p) {
      const int a = static_cast<int>(p);
      if (crossed.count(a) != 0) continue;
      for (const float side : {1.F, -1.F}) {
        const int b = plain_next(graph, pieces, p, side);
        if (b < 0 || !seen.insert({std::min(a, b), std::max(a, b)}).second) continue;
        const CurvePiece& own = pieces.pieces[p];
        const CurvePoint& middle = point_of(graph, own, (own.begin + own.end) / 2);
        expected.push_back({a, b, middle.position, middle.tangent(), side});
      }
    }
    const std::vector<NextPiece> result = next_pieces(camera, graph, pieces);
    ASSERT_EQ(result.size(), expected.size());
    for (std::size_t i = 0; i < result.size(); ++i) {
      EXPECT_EQ(result[i].a, expected[i].a);
      EXPECT_EQ(result[i].b, expected[i].b);
      EXPECT_EQ(result[i].side, expected[i].side);
      EXPECT_EQ(result[i].pixel, expected[i].pixel);
      EXPECT_EQ(result[i].tangent, expected[i].tangent);
    }
    found += result.size();
  }
  EXPECT_GT(found, 60U);
}

TEST(NextPieces, CostIsLeastForTheNextLineAndTheSameFromBothSides) {
  std::vector<PieceLabel> labels;
  for (const int projector : {0, 1}) {
    for (int line = 3; line < 9; ++line) {
      PieceLabel label;
      label.pattern = {projector, 0};
      label.line = line;
      labels.push_back(label);
    }
  }
  for (const PieceLabel& a : labels) {
    for (const PieceLabel& b : labels) {
      EXPECT_EQ(next_piece_cost(a, b, 0), 0);
      for (const int order : {1, -1}) {
        const float cost = next_piece_cost(a, b, order);
        EXPECT_EQ(cost, next_piece_cost(b, a, -order));
        const int grows = a.pattern == b.pattern ? order * (b.line - a.line) : 3;
        if (grows == 1) {
          EXPECT_LT(cost, 0);  // what one hopes for
        } else if (grows == 2) {
          EXPECT_GT(cost, 0);
          EXPECT_LT(cost, 1);
        } else {
          EXPECT_GT(cost, 1);
        }
      }
    }
  }
  // The wrong order, or the same line twice, is worst.
  EXPECT_GT(next_piece_cost(labels[1], labels[0], 1), next_piece_cost(labels[0], labels[4], 1));
  EXPECT_GT(next_piece_cost(labels[1], labels[1], 1), next_piece_cost(labels[0], labels[8], 1));
}

TEST(NextPieces, CountWhereLessThanOneInTenPiecesIsCrossed) {
  PieceGraph graph;
  graph.crossings.resize(9);
  graph.pieces.resize(91);
  EXPECT_TRUE(lacks_crossings(graph));
  graph.pieces.resize(90);
  EXPECT_FALSE(lacks_crossings(graph));
}

/// Stretches of lines on a plane before four cameras, one of them on the plane's other side, each
/// seen by some of them, with labels at the plane's depth and off it.
struct SeenPlane {
  explicit SeenPlane(std::uint64_t seed) {
    rig = sample::small_rig(240, 200, 70);
    rig.cameras.push_back(sample::device_at<Camera>({540, 30, 160}, "cam2", 240, 200, 850));
    rig.cameras.push_back(sample::device_at<Camera>({-560, 0, 80}, "cam3", 240, 200, 900));
    Random random(seed);
    for (int c = 0; c < 4; ++c) {
      graphs.emplace_back();
      graphs.back().camera = c;
    }
    std::vector<std::vector<int>> lines(4);  // per curve
    for (int k = 0; k < 30; ++k) {
      const int family = static_cast<int>(random.below(2));
      const Vec3 center(0, random.uniform(-50, 50), random.uniform(-50, 50));
      const double angle = random.uniform(0, 6.28);
      const Vec3 way(0, std::cos(angle), std::sin(angle));
      const double half = random.uniform(5, 25);
      for (std::size_t c = 0; c < 4; ++c) {
        if (random.below(4) == 0) continue;
        graphs[c].curves.push_back(seen(rig.cameras[c], center, way, half, family, random));
        lines[c].push_back(k);
      }
    }
    for (std::size_t c = 0; c < 4; ++c) {
      LabelledPieces of_camera;
      of_camera.graph = cut_into_pieces(rig.cameras[c], graphs[c], 12);
      for (const CurvePiece& piece : of_camera.graph.pieces) {
        const int line = lines[c][static_cast<std::size_t>(piece.curve)];
        const int family = curve_of(graphs[c], piece).family;
        of_camera.labels.emplace_back();
        for (int other = 0; other < 4; ++other) {
          PieceLabel label;
          label.pattern = {family, 0};
          label.line = line + (other == 2 ? 0 : other);  // the last but one is its own again ...
          if (other == 2) label.pattern.pattern = 1;     // ... in another pattern
          const double off = random.uniform(-1, 1) * (other == 0 ? 0.002 : 0.02);
          label.q = ((1 + off) * plane(rig.cameras[c])).cast<float>();
          if (random.below(5) != 0) of_camera.labels.back().push_back(label);
        }
      }
      pieces.push_back(of_camera);
    }
  }

  /// Inverse depth of the plane x = 0, over (x, y, 1).
  static Vec3 plane(const Camera& camera) {
    const RigidTransform& t = camera.device_from_world;
    const Vec3 normal = t.rotation.col(0);
    return normal / normal.dot(t.translation);
  }

  static Curve seen(const Camera& camera, const Vec3& center, const Vec3& way, double half,
                    int family, Random& random) {
    Curve curve;
    curve.family = family;
    for (double s = -half; s <= half; s += 0.6) {
      const Vec2 at = *camera.project(center + s * way);
      const Vec2 along = (*camera.project(center + (s + 0.1) * way) - at).normalized();
      CurvePoint point;
      point.normal = Eigen::Vector2d(along.y(), -along.x()).cast<float>();
      point.position = at.cast<float>() + static_cast<float>(random.normal(0, 0.4)) * point.normal;
      curve.points.push_back(point);
    }
    return curve;
  }

  /// The piece of a camera nearest across to a place where a line of this family and direction
  /// should be, by all points of it; -1: none within 1.8 px.
  [[nodiscard]] int piece_at(std::size_t g, int family, const Vec2& at, const Vec2& along) const {
    double best = 1.8;
    int found = -1;
    const auto& list = pieces[g].graph.pieces;
    for (std::size_t p = 0; p < list.size(); ++p) {
      if (curve_of(graphs[g], list[p]).family != family) continue;
      for (int i = list[p].begin; i < list[p].end; ++i) {
        const CurvePoint& point = point_of(graphs[g], list[p], i);
        const Vec2 tangent = point.tangent().cast<double>();
        const Vec2 way = at - point.position.cast<double>();
        const double across = std::abs(way.dot(point.normal.cast<double>()));
        const bool is_here = std::abs(way.dot(tangent)) <= 1 && across < best;
        if (!is_here || std::abs(tangent.dot(along)) < 0.9) continue;
        best = across;
        found = static_cast<int>(p);
      }
    }
    return found;
  }

  /// The cost of a label by the cameras that look the same way: a true label is seen with
  /// probability 0.7, a wrong one by chance with 0.2; what is seen has the same line with
  /// probability 0.85, or by chance with 0.03.
  [[nodiscard]] double cost(std::size_t g, std::size_t p, const PieceLabel& label,
                            const std::vector<PieceBeliefs>& beliefs) {
    const Camera& camera = rig.cameras[g];
    const CurvePiece& piece = pieces[g].graph.pieces[p];
    const auto world = [&](const Eigen::Vector2f& at) {
      const Vec3 ray = at.homogeneous().cast<double>();
      return camera.device_from_world.inverse() * (ray / label.q.cast<double>().dot(ray)).eval();
    };
    double sum = 0;
    for (std::size_t o = 0; o < 3; ++o) {  // the fourth sees the other side, and is seen by none
      if (o == g || g == 3) continue;
      const auto at = rig.cameras[o].project(world(piece.middle));
      const auto ahead = rig.cameras[o].project(
          world(piece.middle + 3 / static_cast<float>(camera.K(0, 0)) * piece.tangent));
      if (!at || !ahead || !rig.cameras[o].contains(*at)) continue;
      const int hit =
          piece_at(o, curve_of(graphs[g], piece).family, *at, (*ahead - *at).normalized());
      if (hit < 0) {
        sum -= std::log(0.3 / 0.8);
        ++misses;
        continue;
      }
      ++hits;
      if (beliefs[o].empty()) {
        sum -= std::log(0.7 / 0.2);
        continue;
      }
      double same = 0;
      const auto& theirs = pieces[o].labels[static_cast<std::size_t>(hit)];
      for (std::size_t j = 0; j < theirs.size(); ++j) {
        if (theirs[j].pattern == label.pattern && theirs[j].line == label.line)
          same = static_cast<double>(beliefs[o][static_cast<std::size_t>(hit)][j]);
      }
      sum -= std::log(same * 0.85 / 0.03 + (1 - same) * 0.15 / 0.97);
    }
    return sum;
  }

  Rig rig;
  std::vector<GridGraph> graphs;
  std::vector<LabelledPieces> pieces;
  int hits = 0;
  int misses = 0;
};

TEST(OtherViews, CostIsThatOfAPlainLoopOverAllPoints) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    SeenPlane scene(seed);
    const OtherViews views(scene.rig, scene.graphs, scene.pieces);
    Random random(seed);
    std::vector<PieceBeliefs> beliefs(4);
    for (const bool is_first : {true, false}) {
      for (std::size_t g = 0; g < 4 && !is_first; ++g) {
        if (g != 1) beliefs[g] = random_beliefs(scene.pieces[g], random);
      }
      for (std::size_t g = 0; g < 4; ++g) {
        const auto costs = views.costs(g, beliefs);
        ASSERT_EQ(costs.size(), scene.pieces[g].labels.size());
        for (std::size_t p = 0; p < costs.size(); ++p) {
          ASSERT_EQ(costs[p].size(), scene.pieces[g].labels[p].size());
          for (std::size_t k = 0; k < costs[p].size(); ++k) {
            EXPECT_NEAR(costs[p][k], scene.cost(g, p, scene.pieces[g].labels[p][k], beliefs), 1e-4)
                << g << " " << p << " " << k;
          }
        }
      }
    }
    EXPECT_GT(scene.hits, 300);
    EXPECT_GT(scene.misses, 300);
  }
}

TEST(OtherViews, LabelsThatStayCostTheSameOnceOthersAreForgotten) {
  SeenPlane scene(4);
  OtherViews views(scene.rig, scene.graphs, scene.pieces);
  const std::vector<PieceBeliefs> no_beliefs(4);
  Random random(4);
  std::vector<std::vector<std::vector<float>>> before;
  for (std::size_t g = 0; g < 4; ++g) before.push_back(views.costs(g, no_beliefs));
  std::vector<std::vector<std::vector<int>>> new_index(4);
  for (std::size_t g = 0; g < 4; ++g) {
    for (std::size_t p = 0; p < before[g].size(); ++p) {
      auto& labels = scene.pieces[g].labels[p];
      std::vector<int> index;
      std::vector<float> kept_costs;
      std::vector<PieceLabel> kept;
      for (std::size_t k = 0; k < labels.size(); ++k) {
        const bool stays = random.below(2) == 0;
        index.push_back(stays ? static_cast<int>(kept.size()) : -1);
        if (!stays) continue;
        kept.push_back(labels[k]);
        kept_costs.push_back(before[g][p][k]);
      }
      labels = std::move(kept);
      before[g][p] = std::move(kept_costs);
      new_index[g].push_back(std::move(index));
    }
  }
  views.forget(new_index);
  std::vector<PieceBeliefs> beliefs;
  for (std::size_t g = 0; g < 4; ++g) {
    EXPECT_EQ(views.costs(g, no_beliefs), before[g]);
    beliefs.push_back(random_beliefs(scene.pieces[g], random));
  }
  for (std::size_t g = 0; g < 4; ++g) {
    const auto costs = views.costs(g, beliefs);
    for (std::size_t p = 0; p < costs.size(); ++p) {
      for (std::size_t k = 0; k < costs[p].size(); ++k)
        EXPECT_NEAR(costs[p][k], scene.cost(g, p, scene.pieces[g].labels[p][k], beliefs), 1e-4);
    }
  }
}

TEST(LabelsWorthKeeping, AreTheCheapestWithinTheGap) {
  const std::vector<float> costs = {5, 1, 9, 2, 2, 30};
  using Kept = std::vector<std::size_t>;
  EXPECT_EQ(labels_worth_keeping(costs, 10, 8), (Kept{0, 1, 2, 3, 4}));
  EXPECT_EQ(labels_worth_keeping(costs, 10, 4), (Kept{0, 1, 3, 4}));
  EXPECT_EQ(labels_worth_keeping(costs, 2, 100), (Kept{1, 3}));  // of equal ones the first
  EXPECT_EQ(labels_worth_keeping(costs, 3, 0.5F), (Kept{1}));
  EXPECT_TRUE(labels_worth_keeping({}, 3, 1).empty());
}

}  // namespace
}  // namespace pencilscan
