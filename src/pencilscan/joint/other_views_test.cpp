// Against plain loops over all points and labels.
#include "pencilscan/joint/other_views.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <utility>
#include <vector>

#include "pencilscan/core/random.h"
#include "pencilscan/joint/sample_pieces.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

using sample::curve_of;
using sample::point_of;
using sample::random_beliefs;

/// Stretches of lines on a plane before four cameras, one of them on the plane's other side, each
/// seen by some of them, with labels at the plane's depth and off it.
struct SeenPlane {
  explicit SeenPlane(std::uint64_t seed) {
    rig = sample::small_rig(240, 200, 70);
    rig.cameras.push_back(sample::device_at<Camera>({180, 560, 100}, "cam2", 240, 200, 850));
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
      of_camera.graph = cut_into_pieces(rig.cameras[c], graphs[c], 12, 10);
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

  /// The cost of a label by the cameras that see its side: a true label is seen with probability
  /// 0.7, a wrong one by chance with 0.2 (the first and the third stand wide apart, and each has
  /// the second beside it); what is seen has the same line with probability 0.85, or by chance with
  /// 0.03.
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
      if (o == g || g == 3 || (g != 1 && o != 1)) continue;
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

TEST(OtherViews, WhereNoneStandsNearTwoCamerasWideApartCountLessAndOneNothing) {
  SeenPlane scene(6);
  scene.graphs = {scene.graphs[0], scene.graphs[2], scene.graphs[2]};
  scene.pieces = {scene.pieces[0], scene.pieces[2], scene.pieces[2]};
  int hits = 0;
  int misses = 0;
  for (const auto& of_piece :
       OtherViews(scene.rig, scene.graphs, scene.pieces).costs(0, std::vector<PieceBeliefs>(3))) {
    for (const float cost : of_piece) {
      hits += std::abs(cost + 2 * std::log(0.35F / 0.2F)) < 1e-5F ? 1 : 0;
      misses += std::abs(cost + 2 * std::log(0.65F / 0.8F)) < 1e-5F ? 1 : 0;
    }
  }
  EXPECT_GT(hits, 10);
  EXPECT_GT(misses, 10);
  scene.graphs.pop_back();
  scene.pieces.pop_back();
  for (const auto& of_piece :
       OtherViews(scene.rig, scene.graphs, scene.pieces).costs(0, std::vector<PieceBeliefs>(2))) {
    for (const float cost : of_piece) EXPECT_EQ(cost, 0);
  }
}

TEST(OtherViews, ACameraWithoutCurvesHasNoSay) {
  SeenPlane scene(6);
  scene.graphs[1].curves.clear();
  scene.pieces[1] = {};
  const SeenPlane all(6);
  const std::vector<PieceBeliefs> no_beliefs(4);
  const OtherViews views(scene.rig, scene.graphs, scene.pieces);
  std::vector<GridGraph> graphs = {all.graphs[0], all.graphs[2], all.graphs[3]};
  std::vector<LabelledPieces> pieces = {all.pieces[0], all.pieces[2], all.pieces[3]};
  EXPECT_EQ(views.costs(0, no_beliefs),
            OtherViews(all.rig, graphs, pieces).costs(0, std::vector<PieceBeliefs>(3)));
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
