#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <tuple>
#include <vector>

#include "pencilscan/geometry/types.h"

namespace pencilscan {

/// Points of images, grouped by a key (camera, line, ...), for queries by radius. A sorted list of
/// (key, cell), cells being squares of `cell_px`.
class PixelIndex {
 public:
  explicit PixelIndex(double cell_px) : cell_px_(cell_px) {}

  void add(std::uint64_t key, const Vec2& pixel, std::size_t id) {
    entries_.push_back({key, cell(pixel.y()), cell(pixel.x()), pixel, id});
  }
  /// Must be called after the last add() and before visit().
  void build() { std::sort(entries_.begin(), entries_.end(), before); }

  /// Calls visit(id, pixel) for every point of the key within radius <= cell_px, in a fixed order.
  template <class Visit>
  void visit(std::uint64_t key, const Vec2& at, double radius, const Visit& visit_point) const {
    for (std::int32_t row = cell(at.y()) - 1; row <= cell(at.y()) + 1; ++row) {
      const Entry first{key, row, cell(at.x()) - 1, Vec2::Zero(), 0};
      for (auto it = std::lower_bound(entries_.begin(), entries_.end(), first, before);
           it != entries_.end() && it->key == key && it->row == row &&
           it->column <= cell(at.x()) + 1;
           ++it) {
        if ((it->pixel - at).squaredNorm() <= radius * radius) visit_point(it->id, it->pixel);
      }
    }
  }
  [[nodiscard]] bool any(std::uint64_t key, const Vec2& at, double radius) const {
    bool found = false;
    visit(key, at, radius, [&](std::size_t, const Vec2&) { found = true; });
    return found;
  }

 private:
  struct Entry {
    std::uint64_t key;
    std::int32_t row;
    std::int32_t column;
    Vec2 pixel;
    std::size_t id;
  };
  static bool before(const Entry& a, const Entry& b) {
    return std::tie(a.key, a.row, a.column, a.id) < std::tie(b.key, b.row, b.column, b.id);
  }
  [[nodiscard]] std::int32_t cell(double x) const {
    return static_cast<std::int32_t>(std::floor(x / cell_px_));
  }

  double cell_px_;
  std::vector<Entry> entries_;
};

}  // namespace pencilscan
