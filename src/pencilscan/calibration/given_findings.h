#pragma once

#include <vector>

#include "pencilscan/calibration/calibrate.h"
#include "pencilscan/calibration/finding.h"

namespace pencilscan {

/// Whether a device's given K was kept, exactly or within its tolerance.
[[nodiscard]] bool is_given(const CalibrationResult& result, std::size_t device);

/// How far given K moved, which of them the data contradict, and whether all together do.
[[nodiscard]] std::vector<Finding> given_findings(const CalibrationInput& input,
                                                  const CalibrationResult& result);

}  // namespace pencilscan
