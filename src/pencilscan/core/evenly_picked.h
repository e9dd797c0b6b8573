#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace pencilscan {

/// At most `most` of n values, in their order and evenly spread over it: of m, the k-th is value
/// k n / m, rounded down. All of them where there are no more.
template <typename Values>
[[nodiscard]] std::vector<typename Values::value_type> evenly_picked(const Values& values,
                                                                     std::size_t most) {
  const std::size_t count = std::min(values.size(), most);
  std::vector<typename Values::value_type> picked;
  picked.reserve(count);
  for (std::size_t k = 0; k < count; ++k) picked.push_back(values[k * values.size() / count]);
  return picked;
}

}  // namespace pencilscan
