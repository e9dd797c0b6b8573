#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "pencilscan/capture/camera_device.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// A picture to look at: its mosaic made colour.
[[nodiscard]] cv::Mat picture_to_see(const CameraFrame& frame);

/// A picture as `camera` expects it in files: its mosaic made colour, unless the rig states one.
/// StageError where the picture has another mosaic than the rig states.
[[nodiscard]] cv::Mat picture_for_files(const Camera& camera, const CameraFrame& frame);

/// How many channels these have, by the pixel format that the camera was set to.
[[nodiscard]] int channels_for_files(const Camera& camera, const CameraSettings& made);

/// InputError of `source`, the file of the laboratory, where the pixel format that the camera was
/// set to contradicts the mosaic that the rig states. A format of unknown layout says nothing.
void check_mosaic(const Camera& camera, const CameraSettings& made, const std::string& source);

}  // namespace pencilscan
