#pragma once

#include <vector>

#include "pencilscan/calibration/verdict.h"

namespace pencilscan {

/// Pairs whose correspondences contradict the rig, explained: swapped folders, a device that moved
/// between captures or between projectors, or a scene that moved.
[[nodiscard]] std::vector<Finding> find_suspects(const CalibrationInput& input,
                                                 const CalibrationResult& result);

}  // namespace pencilscan
