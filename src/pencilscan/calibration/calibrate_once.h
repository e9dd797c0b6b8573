#pragma once

#include "pencilscan/calibration/calibrate.h"

namespace pencilscan {

/// One calibration of what it gets: guesses of focal lengths, structure for the best few of them,
/// bundle adjustment in stages (focal lengths; principal points; aspect and k1; the other terms),
/// outliers dropped between them. Given inner parameters stay within their tolerance; what the data
/// contradict goes. Whether the input agrees with the rig that results is asked by calibrate().
/// With `start`, a result for other tracks of the same devices, only the adjustment.
[[nodiscard]] CalibrationResult calibrate_once(const CalibrationInput& input,
                                               const CalibrateOptions& options,
                                               const Progress& progress,
                                               const CalibrationResult* start = nullptr);

}  // namespace pencilscan
