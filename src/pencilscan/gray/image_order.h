#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <string>

#include "pencilscan/gray/gray_decode.h"

namespace pencilscan {

/// Image i of a capture as a grey CV_32FC1.
using GrayImageSource = std::function<cv::Mat(std::size_t)>;

/// When the codes make no sense: the wrong order of the images that would explain it, in words such
/// as "each inverse comes before its pattern"; empty when the codes make sense or no order does.
[[nodiscard]] std::string explain_wrong_order(int panel_width, int panel_height, bool inverses,
                                              const GrayImageSource& image,
                                              const DecodedView& decoded,
                                              const GrayDecodeOptions& options = {});

}  // namespace pencilscan
