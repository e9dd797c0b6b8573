#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "pencilscan/detection/curve.h"

namespace pencilscan {

/// Adds the profile of a curve to a CV_32FC1 image.
void add_curve(const Curve& curve, cv::Mat& image);

/// Takes it away.
void subtract_curve(const Curve& curve, cv::Mat& image);

/// Sum of the profiles of all curves, CV_32FC1.
[[nodiscard]] cv::Mat render_curves(const std::vector<Curve>& curves, cv::Size size);

}  // namespace pencilscan
