#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "pencilscan/geometry/types.h"

namespace pencilscan {

/// Points in equal cubes, for queries of a radius of about one cube. Visits neighbours in an order
/// that depends on nothing but the points.
class PointGrid {
 public:
  /// cell_mm > 0.
  PointGrid(std::span<const Vec3> points, double cell_mm) : cell_(cell_mm) {
    std::vector<std::pair<std::uint64_t, std::uint32_t>> order(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      order[i] = {key(cell_of(points[i])), static_cast<std::uint32_t>(i)};
    }
    std::sort(order.begin(), order.end());
    index_.reserve(order.size());
    for (std::size_t i = 0; i < order.size(); ++i) {
      Run& run = columns_.try_emplace(column_of(order[i].first), Run{i, i}).first->second;
      run.end = i + 1;
      index_.push_back(order[i].second);
      points_.push_back(points[order[i].second]);
      keys_.push_back(order[i].first);
    }
  }

  /// Calls visit(index, squared distance) for every point within `radius` of `center`.
  template <typename Visit>
  void for_each_within(const Vec3& center, double radius, Visit&& visit) const {
    (void)any_within(center, radius, [&](std::size_t i, double d2) {
      visit(i, d2);
      return false;
    });
  }

  /// Whether matches(index, squared distance) for any point within `radius` of `center`.
  template <typename Matches>
  [[nodiscard]] bool any_within(const Vec3& center, double radius, Matches&& matches) const {
    const Cell low = cell_of(center - Vec3::Constant(radius));
    const Cell high = cell_of(center + Vec3::Constant(radius));
    for (std::int64_t x = low[0]; x <= high[0]; ++x) {
      for (std::int64_t y = low[1]; y <= high[1]; ++y) {
        const std::uint64_t least = key({x, y, low[2]});
        const std::uint64_t most = key({x, y, high[2]});
        const auto column = columns_.find(column_of(least));
        if (column == columns_.end()) continue;
        const auto end = keys_.begin() + static_cast<std::ptrdiff_t>(column->second.end);
        auto at = keys_.begin() + static_cast<std::ptrdiff_t>(column->second.begin);
        for (at = std::lower_bound(at, end, least); at != end && *at <= most; ++at) {
          const auto i = static_cast<std::size_t>(at - keys_.begin());
          const double d2 = (points_[i] - center).squaredNorm();
          if (d2 <= radius * radius && matches(static_cast<std::size_t>(index_[i]), d2))
            return true;
        }
      }
    }
    return false;
  }

 private:
  using Cell = std::array<std::int64_t, 3>;
  [[nodiscard]] Cell cell_of(const Vec3& x) const {
    return {static_cast<std::int64_t>(std::floor(x[0] / cell_)),
            static_cast<std::int64_t>(std::floor(x[1] / cell_)),
            static_cast<std::int64_t>(std::floor(x[2] / cell_))};
  }
  /// 21 bits per axis: unique within two million cells, which is any sensible scene. Cells of one
  /// column follow each other.
  [[nodiscard]] static std::uint64_t key(const Cell& c) {
    constexpr std::int64_t kMiddle = 1 << 20;
    constexpr std::uint64_t kMask = (1u << 21) - 1;
    return (static_cast<std::uint64_t>(c[0] + kMiddle) & kMask) << 42 |
           (static_cast<std::uint64_t>(c[1] + kMiddle) & kMask) << 21 |
           (static_cast<std::uint64_t>(c[2] + kMiddle) & kMask);
  }
  [[nodiscard]] static std::uint64_t column_of(std::uint64_t key) { return key >> 21; }

  struct Run {
    std::size_t begin, end;
  };
  double cell_;
  std::vector<Vec3> points_;          ///< sorted by key
  std::vector<std::uint32_t> index_;  ///< points sorted by key
  std::vector<std::uint64_t> keys_;
  std::unordered_map<std::uint64_t, Run> columns_;  ///< of cells with the same x and y
};

}  // namespace pencilscan
