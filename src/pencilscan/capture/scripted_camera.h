#pragma once

#include <functional>
#include <memory>
#include <string>

#include "pencilscan/capture/camera_device.h"

namespace pencilscan {

/// A camera inside this program: pictures come from a function. For tests, and for a virtual
/// laboratory where no network can be had.
struct CameraScript {
  std::string name = "scripted";
  /// The picture of an exposure that begins at host_now_ns() = begin and takes so long; called when
  /// it is over. Empty: the picture got lost.
  std::function<cv::Mat(std::int64_t begin_ns, double exposure_us, double gain)> expose;
  std::string mosaic;
  double clock_ppm = 0;             ///< by which its clock runs fast
  std::int64_t clock_start_ns = 0;  ///< added to its clock
  double phase_s = 0;               ///< of a free-running camera's pictures
  std::int64_t first_number = 0;
};

[[nodiscard]] std::unique_ptr<CameraDevice> make_scripted_camera(CameraScript script);

}  // namespace pencilscan
