#pragma once

#include <opencv2/core.hpp>

namespace pencilscan {

/// Linear light of an image as stored: value^gamma, negative values as 0. The image itself where
/// gamma is 1.
[[nodiscard]] cv::Mat linearized(const cv::Mat& image, double gamma);

}  // namespace pencilscan
