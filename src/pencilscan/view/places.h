#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <vector>

namespace pencilscan {

/// Things at places of an image, found by place.
template <class Thing>
class Places {
 public:
  /// cell_px: about as far as one looks around, px, >= 1.
  Places(int width, int height, int cell_px)
      : cell_px_(cell_px),
        columns_(width / cell_px + 1),
        rows_(height / cell_px + 1),
        cells_(static_cast<std::size_t>(columns_ * rows_)) {}

  void add(const Eigen::Vector2f& at, const Thing& thing) {
    Cell& cell = cells_[index(column(at.x()), row(at.y()))];
    const int entry = static_cast<int>(entries_.size());
    entries_.push_back({thing, -1});
    (cell.first < 0 ? cell.first : entries_[static_cast<std::size_t>(cell.last)].next) = entry;
    cell.last = entry;
  }

  /// How many things there are.
  [[nodiscard]] std::size_t size() const { return entries_.size(); }

  void clear() {
    std::fill(cells_.begin(), cells_.end(), Cell{});
    entries_.clear();
  }

  /// visit(thing) for all within `reach` px, and some farther away; those of one cell in the order
  /// in which they were added.
  template <class Visit>
  void around(const Eigen::Vector2f& at, float reach, Visit visit) const {
    for (int y = row(at.y() - reach); y <= row(at.y() + reach); ++y) {
      for (int x = column(at.x() - reach); x <= column(at.x() + reach); ++x) {
        for (int i = cells_[index(x, y)].first; i >= 0;) {
          const Entry& entry = entries_[static_cast<std::size_t>(i)];
          visit(entry.thing);
          i = entry.next;
        }
      }
    }
  }

  /// True where is_it(thing) is for one within `reach` px, or some farther away, that was not among
  /// the first `known` to be added.
  template <class IsIt>
  [[nodiscard]] bool any_around(const Eigen::Vector2f& at, float reach, std::size_t known,
                                IsIt is_it) const {
    for (int y = row(at.y() - reach); y <= row(at.y() + reach); ++y) {
      for (int x = column(at.x() - reach); x <= column(at.x() + reach); ++x) {
        const Cell& cell = cells_[index(x, y)];
        if (cell.last < static_cast<int>(known)) continue;
        for (int i = cell.first; i >= 0;) {
          const Entry& entry = entries_[static_cast<std::size_t>(i)];
          if (i >= static_cast<int>(known) && is_it(entry.thing)) return true;
          i = entry.next;
        }
      }
    }
    return false;
  }

 private:
  struct Cell {
    int first = -1;
    int last = -1;
  };
  struct Entry {
    Thing thing;
    int next;  ///< of the same cell; -1: none
  };

  [[nodiscard]] int column(float x) const {
    return std::clamp(static_cast<int>(x) / cell_px_, 0, columns_ - 1);
  }
  [[nodiscard]] int row(float y) const {
    return std::clamp(static_cast<int>(y) / cell_px_, 0, rows_ - 1);
  }
  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y * columns_ + x);
  }

  int cell_px_;
  int columns_;
  int rows_;
  std::vector<Cell> cells_;
  std::vector<Entry> entries_;
};

}  // namespace pencilscan
