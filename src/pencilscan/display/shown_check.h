#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>

namespace pencilscan {

/// How what an output shows differs from what it should.
struct ShownDifference {
  std::string kind;      ///< black, covered, other
  double share = 0;      ///< of the panel's pixels that differ
  cv::Rect where;        ///< of them, in panel pixels
  std::string sentence;  ///< "shows black only", "pixels 40..239 x 80..279 show something else"
};

/// Compares an output read back with the picture that it should show (both CV_8UC3, RGB).
///   black: nothing but black is there
///   covered: a rectangle differs, and nothing outside of it
///   other: another picture, or another size
/// Levels may differ by one: some visuals round.
[[nodiscard]] std::optional<ShownDifference> compare_shown(const cv::Mat& shown,
                                                           const cv::Mat& expected);

}  // namespace pencilscan
