#pragma once

#include <opencv2/core.hpp>

namespace pencilscan {

/// Linear light of an image as stored, of any number of channels:
/// (max(0, value - black_level) / (1 - black_level))^gamma. The image itself where gamma is 1 and
/// black_level is 0.
[[nodiscard]] cv::Mat linearized(const cv::Mat& image, double gamma, double black_level = 0);

}  // namespace pencilscan
