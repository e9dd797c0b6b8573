#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

namespace pencilscan {

/// Standard deviation of a Gaussian per median of its absolute value: 1 / quantile(0.75).
inline constexpr double kDeviationPerMedian = 1.4826;
/// Lower quartile of its absolute value per standard deviation: quantile(0.625).
inline constexpr double kLowerQuartilePerDeviation = 0.3186;

/// upper_median() of values that may be put into another order.
template <typename Number>
[[nodiscard]] Number upper_median_in_place(std::span<Number> values) {
  if (values.empty()) return Number{0};
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// The upper median: element size / 2 in order of size. 0 for no values.
template <typename Number>
[[nodiscard]] Number upper_median(std::vector<Number> values) {
  return upper_median_in_place(std::span(values));
}

/// The value that a share of the others is not above: of n in order of size, element
/// share (n - 1), rounded down. 0 for no values. share in [0, 1].
template <typename Number>
[[nodiscard]] Number lower_quantile(std::vector<Number> values, double share) {
  if (values.empty()) return Number{0};
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace pencilscan
