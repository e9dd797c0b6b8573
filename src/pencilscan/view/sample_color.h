#pragma once

#include <Eigen/Core>
#include <limits>
#include <opencv2/core.hpp>

namespace pencilscan {

/// Value between the pixels of an image, in [0, 1] where it is of integers (CV_8U, CV_16U) and as
/// it is where it is CV_32F; of one channel all three are alike. NaN at the border and outside, and
/// where one of the pixels has a value of `full` or more.
[[nodiscard]] Eigen::Array3f sample_color(const cv::Mat& image, double x, double y,
                                          float full = std::numeric_limits<float>::infinity());

}  // namespace pencilscan
