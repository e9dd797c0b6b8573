#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <optional>
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

/// Lit pixels whose codes make sense: they vary smoothly. A share.
[[nodiscard]] double sensible_share(const DecodedView& view);
/// The same with the images in the wrong order that explain_wrong_order() has these words for;
/// nothing where it has not.
[[nodiscard]] std::optional<double> sensible_share_in_order(const std::string& order,
                                                            int panel_width, int panel_height,
                                                            bool inverses,
                                                            const GrayImageSource& image,
                                                            const GrayDecodeOptions& options = {});

}  // namespace pencilscan
