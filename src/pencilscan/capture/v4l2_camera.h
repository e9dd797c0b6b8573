#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "pencilscan/capture/camera_device.h"

namespace pencilscan {

/// The calls of the kernel that a Video4Linux camera is made of, so that a test can answer them.
struct VideoKernel {
  std::function<int(const std::string& path)> open;  ///< -1: errno says why
  std::function<void(int file)> close;
  std::function<int(int file, unsigned long request, void* argument)> control;  ///< ioctl
  std::function<void*(int file, std::size_t length, std::size_t offset)> map;   ///< nullptr: none
  std::function<void(void* memory, std::size_t length)> unmap;
  /// Waits until a picture is there; false when none came in time.
  std::function<bool(int file, Seconds patience)> wait;
};
/// Those of the running kernel.
[[nodiscard]] VideoKernel video_kernel();

/// Webcams, frame grabbers and industrial cameras of the kernel's own drivers.
[[nodiscard]] std::vector<CameraInfo> list_v4l2_cameras();

/// Opens "/dev/video0". Takes raw mosaics and greys as they are; YUYV and MJPG become RGB.
/// Automatic exposure, gain and white balance are off while it is open. StageError when it is no
/// camera.
[[nodiscard]] std::unique_ptr<CameraDevice> open_v4l2_camera(
    const std::string& path, const VideoKernel& kernel = video_kernel());

}  // namespace pencilscan
