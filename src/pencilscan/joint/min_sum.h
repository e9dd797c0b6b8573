#pragma once

#include <cstddef>
#include <vector>

namespace pencilscan {

/// A pairwise energy over discrete variables: sum of unary[i][x_i] and table_e[x_a, x_b].
struct PairwiseEnergy {
  struct Edge {
    int a = 0;
    int b = 0;
    std::size_t table = 0;  ///< start in `tables`: labels(a) x labels(b), row-major
  };
  std::vector<int> first;  ///< of each node's labels in `unary`; nodes + 1 entries
  std::vector<float> unary;
  std::vector<Edge> edges;
  std::vector<float> tables;

  [[nodiscard]] int nodes() const { return static_cast<int>(first.size()) - 1; }
  [[nodiscard]] int labels(int node) const {
    return first[static_cast<std::size_t>(node) + 1] - first[static_cast<std::size_t>(node)];
  }
};

/// Approximate min-marginals of every label by loopy min-sum belief propagation (Pearl 1988;
/// damped, all messages at once): laid out as `unary`. Exact on trees.
[[nodiscard]] std::vector<float> min_sum(const PairwiseEnergy& energy, int rounds, float damping);

}  // namespace pencilscan
