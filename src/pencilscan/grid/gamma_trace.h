#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "pencilscan/grid/grid_graph.h"

namespace pencilscan {

/// What the brightness of crossings says of a picture's gamma.
struct GammaTrace {
  double gamma = 1;           ///< of the values: light is value^gamma; 1: they are light
  double deviation = 0;       ///< of log(gamma), standard
  std::size_t crossings = 0;  ///< that said something
};

/// Light of two projectors adds where their lines cross: with light L = v^gamma, L at the crossing
/// and off both lines are together what they are on either line beside it. `values`: CV_32FC3.
/// Result: log(gamma) of every crossing that says one.
[[nodiscard]] std::vector<double> log_gammas_at_crossings(const GridGraph& graph,
                                                          const cv::Mat& values);
/// Their median; nothing where they are too few.
[[nodiscard]] std::optional<GammaTrace> gamma_of_crossings(const std::vector<double>& logs);

}  // namespace pencilscan
