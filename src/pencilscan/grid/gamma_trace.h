#pragma once

#include <cstddef>
#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <vector>

#include "pencilscan/grid/grid_graph.h"

namespace pencilscan {

// Light of two projectors adds where their lines cross. Let o be the crossing, a a step along one
// line and b a step along the other. Light that is the sum of what is constant along either line
// has L(o) + L(o + a + b) = L(o + a) + L(o + b), however near other lines are, and also after any
// linear filter. With light L = v^gamma, values v give a gamma at every crossing.

/// What one crossing says of a picture's gamma.
struct CrossingGamma {
  double log_gamma = 0;  ///< of the values: light is value^gamma; 0: they are light
  double weight = 0;     ///< > 0: how much the sum changes with log_gamma
};

/// What the brightness of crossings says of a picture's gamma.
struct GammaTrace {
  double gamma = 1;           ///< of the values: light is value^gamma; 1: they are light
  double deviation = 0;       ///< of log(gamma), standard
  std::size_t crossings = 0;  ///< that said something
};

/// The gamma of every crossing that says one. `values`: CV_32FC3.
[[nodiscard]] std::vector<CrossingGamma> gammas_at_crossings(const GridGraph& graph,
                                                             const cv::Mat& values);
/// Their weighted median; nothing where they are too few.
[[nodiscard]] std::optional<GammaTrace> gamma_of_crossings(std::span<const CrossingGamma> said);

}  // namespace pencilscan
