// Against a plain loop over all pieces.
#include "pencilscan/joint/surroundings.h"

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

using sample::add_random_crossings;
using sample::point_of;
using sample::random_beliefs;
using sample::random_curves;

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
    pieces.graph = cut_into_pieces(camera, graph, 12, 10);
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

}  // namespace
}  // namespace pencilscan
