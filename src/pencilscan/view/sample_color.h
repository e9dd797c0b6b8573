#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>

namespace pencilscan {

/// Value between the pixels of a CV_32FC3 image; NaN at the border and outside.
[[nodiscard]] Eigen::Array3f sample_color(const cv::Mat& image, double x, double y);

}  // namespace pencilscan
