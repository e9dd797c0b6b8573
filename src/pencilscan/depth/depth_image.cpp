#include "pencilscan/depth/depth_image.h"

#include <algorithm>
#include <limits>

namespace pencilscan {

DepthImage depth_image(const Device& camera, const DepthMap& map) {
  const cv::Scalar none(std::numeric_limits<double>::quiet_NaN());
  DepthImage image{cv::Mat(camera.height, camera.width, CV_32F, none),
                   cv::Mat(camera.height, camera.width, CV_32F, none)};
  for (int v = 0; v < camera.height; ++v) {
    const int row = std::min((v + map.stride / 2) / map.stride, map.rows - 1);
    for (int u = 0; u < camera.width; ++u) {
      const int column = std::min((u + map.stride / 2) / map.stride, map.columns - 1);
      const DepthNode& n = map.nodes[map.index(row, column)];
      if (!n.measured()) continue;
      const auto dx = static_cast<float>(u - column * map.stride);
      const auto dy = static_cast<float>(v - row * map.stride);
      const float w = n.w + n.wx * dx + n.wy * dy + 0.5F * (n.wxx * dx * dx + n.wyy * dy * dy) +
                      n.wxy * dx * dy;
      if (!(w > 0)) continue;
      image.depth.at<float>(v, u) = 1 / w;
      image.sigma.at<float>(v, u) = n.sigma;
    }
  }
  return image;
}

}  // namespace pencilscan
