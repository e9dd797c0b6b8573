#pragma once

#include <opencv2/core.hpp>
#include <string>

namespace pencilscan {

/// A camera's picture as checks look at it: grey, the mean of blocks of 4 x 4 pixels, [0, 1].
/// Blocks tell neither mosaics nor the finest stripes, and are read in a millisecond.
[[nodiscard]] cv::Mat coarse_picture(const cv::Mat& image);

/// Where a projector's light arrives in one camera: white - black, of coarse pictures.
struct LitView {
  cv::Mat black;
  cv::Mat light;         ///< white - black
  cv::Mat lit;           ///< CV_8U: where the light stands out of noise and dark surroundings
  double share = 0;      ///< of the blocks, lit
  double brightest = 0;  ///< 95th percentile of `light` over lit blocks
  double saturated = 0;  ///< share of the lit blocks whose white reaches the end of the range

  /// The camera sees the projector: as much is lit as a hand at arm's length covers.
  [[nodiscard]] bool is_seen() const { return share >= kLeastSeen; }
  static constexpr double kLeastSeen = 0.002;
};
/// Both as coarse_picture() makes them, of one size.
[[nodiscard]] LitView lit_view(const cv::Mat& white, const cv::Mat& black);

/// What is wrong with a pattern and its inverse in one camera; empty: nothing.
///
/// A block that is bright under a pattern is dark under its inverse, whatever surface, gamma and
/// room are: so where a picture shows another pattern, one that was replaced halfway through the
/// exposure, or a scene that moved in between, blocks are bright or dark in both. Only blocks whole
/// within a stripe count.
[[nodiscard]] std::string pair_trouble(const cv::Mat& pattern, const cv::Mat& inverse,
                                       const LitView& view);

/// What is wrong when white is shown again after everything.
struct WhiteTrouble {
  std::string why;     ///< empty: nothing
  bool moved = false;  ///< the scene or the camera did; else the lamp's light changed
};
[[nodiscard]] WhiteTrouble white_again_trouble(const cv::Mat& white, const cv::Mat& again,
                                               const LitView& view);

}  // namespace pencilscan
