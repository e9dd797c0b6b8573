#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/core/warning.h"
#include "pencilscan/pipeline/cut_lines.h"
#include "pencilscan/pipeline/frame.h"
#include "pencilscan/pipeline/line_naming.h"

namespace pencilscan {

/// A frame's notes and what detection says of its pictures: colours that mix, no picture, no lines,
/// saturation.
[[nodiscard]] std::vector<Warning> detection_warnings(const Rig& rig, const Frame& frame,
                                                      std::span<const ColorFamily> families,
                                                      std::span<const CameraDetection> detections);

/// `projectors`: of NamingDoubt::alike().
[[nodiscard]] Warning alike_warning(const std::string& projectors);
/// Of NamingDoubt::of_projectors().
[[nodiscard]] Warning naming_warning(const std::string& doubt);

/// Cameras and projectors that have hardly any of the lines that the measured surface lets expect,
/// where the others have theirs. A camera is also named where it has less than half of the others'
/// share, and the solution named less than half of theirs. `expected`: per camera and projector;
/// `named`: per camera, by the solution, or empty.
[[nodiscard]] std::vector<Warning> missing_lines_warnings(
    const Rig& rig, std::span<const std::vector<ExpectedLines>> expected,
    std::span<const TellingPoints> named);

/// That the volume cuts what was measured.
[[nodiscard]] std::optional<Warning> volume_warning(const Rig& rig, const CutLines& lines);

/// That the floor which the rig states cuts it; `lines`: above that floor.
[[nodiscard]] std::optional<Warning> floor_cut_warning(const Rig& rig, const CutLines& lines);

/// That the object stands on a plane, and how to state it; lengths in the rig's unit.
[[nodiscard]] Warning floor_warning(const FoundFloor& found);

/// The share of the points of all curves that have a name; 1 without any.
[[nodiscard]] double share_of_named_points(std::span<const GridGraph> graphs,
                                           const Labeling& labeling);
/// Another ring's rig, or one with two of the six cameras' names: .3 to 5.5 % (13 frames). Right
/// rigs: 70 % and more (492 frames of drawn and kept-apart rigs), and down to 3 % where one
/// projector's lines are 34 px apart.
inline constexpr double kHardlyNamed = 0.1;
/// Whether crossings say that the rig is off. Names of so few curves may all be wrong, and then
/// they miss each other whatever the rig is.
[[nodiscard]] bool deny_rig(const CrossingDisagreement& crossings, double share_of_named_points);
/// That hardly any of the lines in the pictures could be named.
[[nodiscard]] std::optional<Warning> few_names_warning(const PointResult& result);

/// That the object moved while the shutters were open; lengths in the rig's unit.
[[nodiscard]] Warning motion_warning(const Rig& rig, const ExposureMotion& motion);

}  // namespace pencilscan
