#pragma once

#include <opencv2/core.hpp>

#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// An image (of float) whose pixel (u, v) is the mean around pixel (n u, n v), n = binning >= 1: of
/// n x n pixels where n is odd, else of n + 1 along a row and a column, the outer ones half.
[[nodiscard]] cv::Mat binned(const cv::Mat& image, int binning);

/// The same of an image with one channel, of the pixels alone that are `counted` (CV_32FC1: 1,
/// others 0); of all of them where none is.
[[nodiscard]] cv::Mat binned(const cv::Mat& image, const cv::Mat& counted, int binning);

/// Variance that they add to a line's profile, along a row or a column, px^2 of the image joined.
[[nodiscard]] double binning_blur_px2(int binning);

/// The camera of such images, which are linear light.
[[nodiscard]] Camera binned(Camera camera, int binning);

}  // namespace pencilscan
