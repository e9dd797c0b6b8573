#pragma once

#include <filesystem>

#include "pencilscan/io/curve_file.h"
#include "pencilscan/pipeline/frame.h"

namespace pencilscan {

/// Every detected curve with its code evidence, its label or the reason why it has none, and the
/// crossings. In space, the curves of a camera lie where its rays meet the plane that touches the
/// rig's volume on the camera's side, square to its axis: as its picture, standing there.
[[nodiscard]] CurveFile describe_curves(const Rig& rig, const PointResult& points);

/// pictures/<camera>.jpg: what each camera saw, as shown on a screen (gamma 2.2).
void write_camera_pictures(const std::filesystem::path& folder, const Rig& rig, const Frame& frame);

}  // namespace pencilscan
