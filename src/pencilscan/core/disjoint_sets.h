#pragma once

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

namespace pencilscan {

/// Which of the elements 0, 1, ... belong together: union-find with path halving (Tarjan and van
/// Leeuwen, "Worst-case analysis of set union algorithms", 1984).
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }

  /// The same element for all of a set: its smallest one.
  [[nodiscard]] int root(int element) {
    while (parent(element) != element) element = parent(element) = parent(parent(element));
    return element;
  }
  void join(int a, int b) {
    const int ra = root(a);
    const int rb = root(b);
    parent(std::max(ra, rb)) = std::min(ra, rb);
  }

 private:
  int& parent(int element) { return parent_[static_cast<std::size_t>(element)]; }

  std::vector<int> parent_;
};

}  // namespace pencilscan
