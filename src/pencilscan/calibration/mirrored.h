#pragma once

#include <optional>

#include "pencilscan/calibration/verdict.h"

namespace pencilscan {

/// Where much contradicts an unusable result: the device whose pictures are mirrored (a projector
/// set to projection from behind, a camera's driver), or that those of all cameras are. No rotation
/// makes good for that. Calibrates again with some of the tracks for each of them, the one that
/// fits worst first: takes a while, and only where something is wrong.
[[nodiscard]] std::optional<Finding> find_mirrored(const CalibrationInput& input,
                                                   const CalibrationResult& result,
                                                   const CalibrateOptions& options,
                                                   const Progress& progress = {});

}  // namespace pencilscan
