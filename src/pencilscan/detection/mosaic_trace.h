#pragma once

#include <opencv2/core.hpp>

namespace pencilscan {

/// Whether the colours of a picture (CV_32FC3) were filled in behind a mosaic: samples differ from
/// the mean of their neighbours by more than what was interpolated from these (after Gallagher and
/// Chen 2008). In a picture of three full channels, the four places of a 2 x 2 mosaic are alike.
[[nodiscard]] bool looks_interpolated(const cv::Mat& rgb);

}  // namespace pencilscan
