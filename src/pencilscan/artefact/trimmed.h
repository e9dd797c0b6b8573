#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <vector>

#include "pencilscan/geometry/types.h"

namespace pencilscan {

/// A fit to the points that remain when the worst are removed.
template <typename Model>
struct TrimmedFit {
  Model model;
  std::vector<std::size_t> kept;  ///< indices of points, ascending
};

/// From each start: removes the `removed` points that are farthest from it, fits to the rest, and
/// so on until the same points are removed; of all ends the one with the least sum of squares
/// (least trimmed squares by concentration: Rousseeuw, Van Driessen, Data Mining and Knowledge
/// Discovery 12, 2006). A single removal after a fit that outliers have bent would remove good
/// points in place of bad ones. fit(points, from) gives optional<Model>, distance(model, point) a
/// signed distance. Ties go by index.
template <typename Model, typename Fit, typename Distance>
std::optional<TrimmedFit<Model>> fit_trimmed(std::span<const Vec3> points, std::size_t removed,
                                             const std::vector<Model>& starts, const Fit& fit,
                                             const Distance& distance) {
  constexpr int kMostRounds = 50;
  std::optional<TrimmedFit<Model>> best;
  double least = std::numeric_limits<double>::infinity();
  std::vector<std::size_t> order(points.size());
  std::vector<double> size(points.size());
  for (const Model& start : starts) {
    TrimmedFit<Model> result{start, {}};
    double sum = 0;
    for (int round = 0; round < kMostRounds; ++round) {
      for (std::size_t i = 0; i < points.size(); ++i)
        size[i] = std::abs(distance(result.model, points[i]));
      std::iota(order.begin(), order.end(), std::size_t{0});
      std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        return size[a] != size[b] ? size[a] < size[b] : a < b;
      });
      std::vector<std::size_t> kept(order.begin(),
                                    order.end() - static_cast<std::ptrdiff_t>(removed));
      std::sort(kept.begin(), kept.end());
      sum = 0;
      for (const std::size_t i : kept) sum += size[i] * size[i];
      if (kept == result.kept) break;
      std::vector<Vec3> rest;
      rest.reserve(kept.size());
      for (const std::size_t i : kept) rest.push_back(points[i]);
      const auto model = fit(std::span<const Vec3>(rest), result.model);
      if (!model) break;
      result = {*model, std::move(kept)};
    }
    if (!result.kept.empty() && sum < least) {
      least = sum;
      best = std::move(result);
    }
  }
  return best;
}

}  // namespace pencilscan
