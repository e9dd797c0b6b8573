#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace pencilscan {

/// The upper median: element size / 2 in order of size. 0 for no values.
template <typename Number>
[[nodiscard]] Number upper_median(std::vector<Number> values) {
  if (values.empty()) return Number{0};
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace pencilscan
