#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>

namespace pencilscan {

/// Counts of values in even bins from 0 to the 98th percentile (rounded up to two digits), the rest
/// in `above`; with median and 90th percentile. Not finite values are left out; null of nothing.
[[nodiscard]] nlohmann::ordered_json histogram(std::span<const float> values, int bins = 40);

}  // namespace pencilscan
