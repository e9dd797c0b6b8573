#pragma once

#include <optional>
#include <span>

#include "pencilscan/core/warning.h"
#include "pencilscan/pipeline/frame.h"

namespace pencilscan {

/// Which cameras' colours were filled in behind a mosaic, if any.
[[nodiscard]] std::optional<Warning> interpolation_warning(
    const Rig& rig, std::span<const CameraDetection> detections);

/// Which cameras' values are not the light that the rig says, and with which gamma they would be
/// (grid/gamma_trace.h).
[[nodiscard]] std::optional<Warning> gamma_warning(const Rig& rig, const Frame& frame,
                                                   std::span<const CameraDetection> detections,
                                                   std::span<const GridGraph> graphs);

/// How bright lines are against the noise of their pictures, the median over all curve points; 0
/// without any.
[[nodiscard]] double signal_to_noise(const PointResult& result);
/// That light is too little, where the lines that were found are so faint that others must be lost;
/// or that lines are too close together to tell, in the pixels of `rig`.
[[nodiscard]] std::optional<Warning> little_light_warning(const Rig& rig,
                                                          const PointResult& result);

}  // namespace pencilscan
