#pragma once

#include "pencilscan/calibration/calibrate.h"
#include "pencilscan/calibration/pair_fit.h"

namespace pencilscan {

/// Reprojection errors at the solution: those of `result.problem`, and those of `result.held_out`,
/// which loses the views that contradict both their pair and `fit`, as the tracks used did.
void measure_errors(const CalibrationInput& input, const CalibrateOptions& options,
                    const PairFit& fit, CalibrationResult& result);

}  // namespace pencilscan
