#pragma once

#include <opencv2/core.hpp>

#include "pencilscan/io/mosaic.h"

namespace pencilscan {

/// Light behind a mosaic, CV_32FC1 to CV_32FC3 RGB, each colour from its own samples, which stay as
/// they are. Midway between samples it is on the cubic through four of a row or column (Keys, Cubic
/// convolution interpolation for digital image processing, 1981). Of lines four samples apart that
/// keeps .88 of the contrast there, the mean of two samples (demosaiced() in io/mosaic.h, what
/// cameras do) .71; of the deviation of noise .80 and .71.
[[nodiscard]] cv::Mat light_behind(const cv::Mat& raw, const Mosaic& mosaic);

}  // namespace pencilscan
