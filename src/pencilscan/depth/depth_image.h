#pragma once

#include <opencv2/core.hpp>

#include "pencilscan/depth/depth_map.h"
#include "pencilscan/geometry/device.h"

namespace pencilscan {

/// A depth map at the camera's full resolution: each pixel from the quadric of its nearest node.
struct DepthImage {
  cv::Mat depth;  ///< CV_32F, camera z in mm; NaN: none
  cv::Mat sigma;  ///< CV_32F, mm of camera z, one standard deviation; NaN: none
};

[[nodiscard]] DepthImage depth_image(const Device& camera, const DepthMap& map);

}  // namespace pencilscan
