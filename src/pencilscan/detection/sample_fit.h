#pragma once

#include <opencv2/core.hpp>

#include "pencilscan/detection/curve.h"

namespace pencilscan {

/// Fits a curve to the samples of a mosaic that the other curves leave: each counts once, where it
/// lies, over `half_arc` points to either side. `residual`: presence less all curves, this one too;
/// `samples`: CV_8UC1, 0 where presence is interpolated. Points whose fit fails stay.
void fit_to_samples(const cv::Mat& residual, const cv::Mat& samples, int half_arc, Curve& curve);

}  // namespace pencilscan
