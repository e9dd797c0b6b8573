#pragma once

#include <opencv2/core.hpp>
#include <optional>

#include "pencilscan/grid/grid_graph.h"

namespace pencilscan {

/// What the brightness of crossings says of a picture's gamma.
struct GammaTrace {
  double gamma = 1;           ///< of the values: light is value^gamma; 1: they are light
  double deviation = 0;       ///< of log(gamma), standard
  std::size_t crossings = 0;  ///< that said something
};

/// Light of two projectors adds where their lines cross: with light L = v^gamma, L at the crossing
/// and off both lines are together what they are on either line beside it. `values`: CV_32FC3. The
/// median over crossings; nothing where too few say it.
[[nodiscard]] std::optional<GammaTrace> gamma_at_crossings(const GridGraph& graph,
                                                           const cv::Mat& values);

}  // namespace pencilscan
