#include "cluster_enumeration.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "pencilscan/core/random.h"

namespace pencilscan {
namespace {

/// A grid of nodes whose labels are bound to a common shift; unary costs are noise.
struct BoundGrid {
  static constexpr int kSide = 6;
  static constexpr int kLabels = 7;
  PairwiseEnergy energy;

  explicit BoundGrid(std::uint64_t seed) {
    Random random(seed);
    for (int i = 0; i <= kSide * kSide; ++i) energy.first.push_back(i * kLabels);
    for (int i = 0; i < kSide * kSide * kLabels; ++i)
      energy.unary.push_back(static_cast<float>(random.normal(0, 1)));
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        if (x > 0) bind(y * kSide + x - 1, y * kSide + x);
        if (y > 0) bind((y - 1) * kSide + x, y * kSide + x);
      }
    }
  }
  void bind(int a, int b) {
    energy.edges.push_back({a, b, energy.tables.size()});
    for (int i = 0; i < kLabels; ++i) {
      for (int j = 0; j < kLabels; ++j) energy.tables.push_back(i == j ? 0.F : 8.F);
    }
  }
  [[nodiscard]] int best_shift() const {
    std::array<float, kLabels> sum{};
    for (std::size_t i = 0; i < energy.unary.size(); ++i) sum[i % kLabels] += energy.unary[i];
    return static_cast<int>(std::min_element(sum.begin(), sum.end()) - sum.begin());
  }
};

TEST(ClusterEnumeration, FindsTheCommonShiftThatAllNodesTogetherPrefer) {
  for (const std::uint64_t seed : {1U, 2U, 3U, 4U}) {
    const BoundGrid grid(seed);
    // One cluster holds all: the enumeration of shifts is exact.
    const std::vector<float> costs = enumerate_clusters(grid.energy, {.max_size = 100});
    for (int node = 0; node < grid.energy.nodes(); ++node) {
      const auto first = costs.begin() + grid.energy.first[static_cast<std::size_t>(node)];
      const auto best = std::min_element(first, first + BoundGrid::kLabels);
      EXPECT_EQ(best - first, grid.best_shift()) << "seed " << seed << " node " << node;
      EXPECT_FLOAT_EQ(*best, 0);
    }
  }
}

}  // namespace
}  // namespace pencilscan
