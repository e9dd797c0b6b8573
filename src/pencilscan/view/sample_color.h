#pragma once

#include <Eigen/Core>
#include <limits>
#include <opencv2/core.hpp>

namespace pencilscan {

/// Value between the pixels of a CV_32FC3 image; NaN at the border and outside, and where one of
/// the pixels has a value of `full` or more.
[[nodiscard]] Eigen::Array3f sample_color(const cv::Mat& image, double x, double y,
                                          float full = std::numeric_limits<float>::infinity());

}  // namespace pencilscan
