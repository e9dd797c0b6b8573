#pragma once

#include <vector>

#include "pencilscan/calibration/flat_scene.h"

namespace pencilscan {

/// What is to be said of the scale: whether it is known, how well, and whether the known distance,
/// the board and given poses tell the same one.
[[nodiscard]] std::vector<Finding> scale_findings(const CalibrationInput& input,
                                                  const CalibrationResult& result,
                                                  const Uncertainty& uncertainty,
                                                  const FlatScene& scene,
                                                  const VerdictOptions& options);

}  // namespace pencilscan
