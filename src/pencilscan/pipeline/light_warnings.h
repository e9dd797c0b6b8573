#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/core/warning.h"
#include "pencilscan/grid/gamma_trace.h"
#include "pencilscan/pipeline/frame.h"

namespace pencilscan {

/// Which cameras' colours were filled in behind a mosaic, if any.
[[nodiscard]] std::optional<Warning> interpolation_warning(
    const Rig& rig, std::span<const CameraDetection> detections);

/// With which gamma the values of each camera's picture are light that adds where its lines cross,
/// whatever the rig states (grid/gamma_trace.h); nothing where too few crossings say it. Cameras
/// with few say it together.
[[nodiscard]] std::vector<std::optional<GammaTrace>> gammas_of_light(
    const Rig& rig, const Frame& frame, std::span<const GridGraph> graphs);
/// Which cameras' values are not the light that the rig says, and with which gamma they would be.
[[nodiscard]] std::optional<Warning> gamma_warning(
    const Rig& rig, std::span<const std::optional<GammaTrace>> gammas);
/// Which cameras have pictures of 8 bits, no gamma in the rig, and may have one; empty: none.
[[nodiscard]] std::string gamma_note(const Rig& rig, const Frame& frame,
                                     std::span<const std::optional<GammaTrace>> gammas);

/// How bright lines are against the noise of a sample of their pictures, the median over all curve
/// points; 0 without any. A mosaic leaves samples out, which makes places less sure, and no light.
[[nodiscard]] double signal_to_noise(const Rig& rig, const PointResult& result);
/// That light is too little, where the lines that were found are so faint that others must be lost;
/// or that lines are too close together to tell, in the pixels of `rig`.
[[nodiscard]] std::optional<Warning> little_light_warning(const Rig& rig,
                                                          const PointResult& result);

}  // namespace pencilscan
