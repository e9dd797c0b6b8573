#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "pencilscan/detection/ridge.h"

namespace pencilscan {

// Which size of the image shows a line best (scale selection after Lindeberg, "Edge detection and
// ridge detection with automatic scale selection", IJCV 1998). A ridge of height h and a filter of
// scale s give the response L(s); the scale with the largest s^(2 gamma) L(s) is chosen, gamma =
// 3/4. Every image here has half the size of the one before, and the same filter looks at each:
// responses in an image's own pixels are s^2 L(s) but for one factor, the contrast whatever the
// width. A box of width w is seen best at w = 2.4 s; the next size wins where w exceeds 3.3 s, just
// before the filter's answer splits into two, at 3.46 s.

/// An image at one size, and its ridgels in its own pixels.
struct SizedRidgels {
  cv::Mat image;
  std::vector<Ridgel> ridgels;
};

/// Ridgels of all lines in pixels of the full image, from looks at full, half, quarter ... size.
///
/// A pattern has lines of one width, so a picture of one has narrow ones or wide ones. In a picture
/// of narrow lines, half the size adds what the full size does not show, nothing else. In one of
/// wide lines every size competes, and ridgels weaker than `weakest` do not take part. Where the
/// usual line is seen best at sizes[usual], what sizes up to that one show are lines: where two
/// sizes show them about equally well, competition would cut them into pieces.
[[nodiscard]] std::vector<Ridgel> choose_sizes(const std::vector<SizedRidgels>& sizes,
                                               float weakest, std::size_t usual = 0);

}  // namespace pencilscan
