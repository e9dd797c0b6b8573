#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/core/warning.h"
#include "pencilscan/pipeline/cut_lines.h"
#include "pencilscan/pipeline/frame.h"
#include "pencilscan/pipeline/view_agreement.h"

namespace pencilscan {

/// A frame's notes and what detection says of its pictures: colours that mix, no picture, no lines,
/// saturation.
[[nodiscard]] std::vector<Warning> detection_warnings(const Rig& rig, const Frame& frame,
                                                      std::span<const ColorFamily> families,
                                                      std::span<const CameraDetection> detections);

/// Which cameras' colours were filled in behind a mosaic, if any.
[[nodiscard]] std::optional<Warning> interpolation_warning(
    const Rig& rig, std::span<const CameraDetection> detections);

/// Which cameras' values are not the light that the rig says, and with which gamma they would be
/// (grid/gamma_trace.h).
[[nodiscard]] std::optional<Warning> gamma_warning(const Rig& rig, const Frame& frame,
                                                   std::span<const CameraDetection> detections,
                                                   std::span<const GridGraph> graphs);

/// `projectors`: of NamingDoubt::alike().
[[nodiscard]] Warning alike_warning(const std::string& projectors);
/// Of NamingDoubt::of_projectors().
[[nodiscard]] Warning naming_warning(const std::string& doubt);
/// Crossings miss each other by more than noise; what was done about it.
[[nodiscard]] Warning rig_warning(const CrossingDisagreement& crossings, RigInFrame rig_in_frame);

/// The one device whose crossings miss each other by far more than noise, where the rig as a whole
/// does not (per device: cameras, then projectors). Counts alike in all resolutions.
[[nodiscard]] std::optional<std::size_t> device_that_is_off(
    std::span<const CrossingDisagreement> device_crossings);
/// By how much its crossings miss, and what noise explains, in plain words.
[[nodiscard]] std::string misses_text(const Device& device, const CrossingDisagreement& crossings);
[[nodiscard]] std::optional<Warning> device_warning(
    const Rig& rig, std::span<const CrossingDisagreement> device_crossings);

/// Projectors that have hardly any of the lines that the measured surface lets expect, where the
/// others have theirs.
[[nodiscard]] std::vector<Warning> missing_lines_warnings(const Rig& rig,
                                                          std::span<const ExpectedLines> expected);

/// That the volume cuts what was measured.
[[nodiscard]] std::optional<Warning> volume_warning(const Rig& rig, const CutLines& lines);

/// That hardly any of the lines in the pictures could be named.
[[nodiscard]] std::optional<Warning> few_names_warning(const PointResult& result);

/// How bright lines are against the noise of their pictures, the median over all curve points; 0
/// without any.
[[nodiscard]] double signal_to_noise(const PointResult& result);
/// That light is too little, where the lines that were found are so faint that others must be lost;
/// or that lines are too close together to tell, in the pixels of `rig`.
[[nodiscard]] std::optional<Warning> little_light_warning(const Rig& rig,
                                                          const PointResult& result);

/// That what one camera sees lies apart from what the others see, and that it was left out, or not.
[[nodiscard]] Warning another_moment_warning(const Rig& rig, std::size_t camera,
                                             const ViewsApart& apart, bool is_left_out);

/// That depths of different cameras are not those of one surface, by so many deviations.
[[nodiscard]] Warning views_warning(double deviations);

/// That depth maps of different cameras do not fit each other (ConsistencyReport::sigma_scale),
/// where nothing that was `said` explains it.
[[nodiscard]] std::optional<Warning> depth_warning(double deviations,
                                                   std::span<const Warning> said);

/// That the object moved while the shutters were open; lengths in the rig's unit.
[[nodiscard]] Warning motion_warning(const Rig& rig, const ExposureMotion& motion);

}  // namespace pencilscan
