#pragma once

#include <vector>

#include "pencilscan/calibration/calibrate.h"

namespace pencilscan {

/// Whether the scene moved while a capture was taken. The pictures of one projector are taken
/// within a second, those of the next one later: then a camera's pixel sees surface at one depth by
/// the codes of one projector and at another by those of the next, while cameras agree about the
/// codes of each. The adjustment drops what contradicts, and looks sound. So it is done once more
/// without what joins projectors, where these seem to differ: a scene that rested is then measured
/// alike by all. A projector that fewer than two cameras see says nothing.
[[nodiscard]] std::vector<SceneMove> moved_within_captures(const CalibrationInput& input,
                                                           const CalibrationResult& result,
                                                           const CalibrateOptions& options);

}  // namespace pencilscan
