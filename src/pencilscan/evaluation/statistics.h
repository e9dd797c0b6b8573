#pragma once

#include <span>
#include <vector>

namespace pencilscan {

/// Quantile q in [0, 1] by linear interpolation between order statistics; NaN for no values.
[[nodiscard]] double quantile(std::vector<double> values, double q);

/// Spearman's rank correlation; equal values share their mean rank. 0 when either side is constant.
[[nodiscard]] double rank_correlation(std::span<const double> a, std::span<const double> b);

/// Figures of a set of distances.
struct DistanceFigures {
  std::size_t count = 0;
  double median_mm = 0;
  double p90_mm = 0;
  double rms_mm = 0;
  double share_above_2mm = 0;
};
/// All NaN but the count when empty.
[[nodiscard]] DistanceFigures distance_figures(std::span<const double> distances_mm);

/// A share that says of how many.
struct Share {
  std::size_t count = 0;  ///< of the whole
  std::size_t hits = 0;
  /// NaN of nothing.
  [[nodiscard]] double value() const;
  void add(bool hit) {
    ++count;
    hits += hit ? 1 : 0;
  }
};

/// How well sigma predicts the error.
struct SigmaFigures {
  Share below_one;              ///< ideal 0.683
  Share below_two;              ///< ideal 0.954
  std::vector<double> tenths;   ///< below_one within each tenth of the values by sigma
  double rank_correlation = 0;  ///< of sigma with the error
};
/// One error, >= 0, per sigma.
[[nodiscard]] SigmaFigures sigma_figures(std::span<const double> sigmas,
                                         std::span<const double> errors);

}  // namespace pencilscan
