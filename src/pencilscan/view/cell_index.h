#pragma once

#include <algorithm>
#include <cstddef>
#include <opencv2/core.hpp>
#include <vector>

#include "pencilscan/view/nearest.h"

namespace pencilscan {

/// Items by the square cell of the image that holds them; outside, the nearest cell.
class CellIndex {
 public:
  /// Item i < count lies at place(i), which has x and y.
  template <class Place>
  CellIndex(cv::Size size, int cell_px, std::size_t count, Place place)
      : inverse_cell_(1 / static_cast<float>(cell_px)),
        columns_(size.width / cell_px + 1),
        rows_(size.height / cell_px + 1),
        first_(static_cast<std::size_t>(columns_ * rows_) + 1, 0),
        items_(count) {
    std::vector<int> cells(count);
    for (std::size_t i = 0; i < count; ++i) {
      const auto [x, y] = place(i);
      cells[i] = row(y) * columns_ + column(x);
      ++first_[static_cast<std::size_t>(cells[i]) + 1];
    }
    for (std::size_t c = 1; c < first_.size(); ++c) first_[c] += first_[c - 1];
    std::vector<int> next(first_.begin(), first_.end() - 1);
    for (std::size_t i = 0; i < count; ++i) {
      items_[static_cast<std::size_t>(next[static_cast<std::size_t>(cells[i])]++)] =
          static_cast<int>(i);
    }
  }

  /// Items ordered by cell.
  [[nodiscard]] const std::vector<int>& items() const { return items_; }

  /// Visits the items in a square of +-radius around (x, y), and some just outside, until `visit`
  /// gives false.
  template <class Visit>
  void around(float x, float y, float radius, Visit visit) const {
    ranges(x, y, radius, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        if (!visit(items_[i])) return false;
      }
      return true;
    });
  }

  /// The same as ranges of items().
  template <class Visit>
  void ranges(float x, float y, float radius, Visit visit) const {
    const int left = column(x - radius);
    const int right = column(x + radius);
    const int bottom = row(y + radius);
    for (int r = row(y - radius); r <= bottom; ++r) {
      const auto begin = first_[static_cast<std::size_t>(r * columns_ + left)];
      const auto end = first_[static_cast<std::size_t>(r * columns_ + right) + 1];
      if (!visit(static_cast<std::size_t>(begin), static_cast<std::size_t>(end))) return;
    }
  }

 private:
  [[nodiscard]] int column(float x) const {
    return std::clamp(nearest(x * inverse_cell_), 0, columns_ - 1);
  }
  [[nodiscard]] int row(float y) const {
    return std::clamp(nearest(y * inverse_cell_), 0, rows_ - 1);
  }

  float inverse_cell_;
  int columns_;
  int rows_;
  std::vector<int> first_;  ///< of each cell's items in items_; cells + 1 entries
  std::vector<int> items_;
};

}  // namespace pencilscan
