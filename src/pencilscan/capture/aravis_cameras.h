#pragma once

#include <memory>
#include <string>
#include <vector>

#include "pencilscan/capture/camera_device.h"

namespace pencilscan {

/// True when this program was built with Aravis.
[[nodiscard]] bool has_aravis();

/// GigE Vision and USB3 Vision cameras that answer now.
[[nodiscard]] std::vector<CameraInfo> list_aravis_cameras();

/// Opens one by its identity ("Basler-23456789"), serial number or network address. StageError when
/// it does not answer or somebody else holds it.
[[nodiscard]] std::unique_ptr<CameraDevice> open_aravis_camera(const std::string& name);

}  // namespace pencilscan
