#pragma once

#include <span>
#include <vector>

#include "pencilscan/guided/predicted_lines.h"

namespace pencilscan {

/// Predicted points of one line, each next to the one before.
using LineChain = std::vector<PredictedPoint>;

/// Links predicted points of the same line up to 2.5 px apart, ordered by pattern and line.
[[nodiscard]] std::vector<LineChain> chain_points(std::span<const PredictedPoint> points);

}  // namespace pencilscan
