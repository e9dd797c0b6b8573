#pragma once

#include <optional>

#include "pencilscan/calibration/calibrate.h"
#include "pencilscan/calibration/finding.h"

namespace pencilscan {

/// Where much that makes sense pair by pair contradicts a result, and swapped folders are no
/// reason: the device whose pictures are mirrored (a projector set to projection from behind, a
/// camera's driver), or that those of all cameras are. No rotation makes good for that. The
/// adjustment may drop nearly all that such a device sees, and the rest looks good. Finds a rig
/// again from some of the tracks for each device that fits badly, the worst first. Where nothing
/// contradicts nothing is tried.
[[nodiscard]] std::optional<Mirroring> find_mirrored(const CalibrationInput& input,
                                                     const CalibrationResult& result,
                                                     const CalibrateOptions& options,
                                                     const Progress& progress = {});

[[nodiscard]] Finding mirrored_finding(const Rig& rig, const Mirroring& mirrored);

}  // namespace pencilscan
