#pragma once

#include <optional>
#include <vector>

#include "pencilscan/pipeline/frame.h"

namespace pencilscan {

/// A frame as cameras of fewer pixels would see it. All lengths in pixels that the stages have,
/// from the samples of a profile to the windows of dense depth, suit lines that lie as far apart as
/// such a window is wide. Where ordinary cameras of five million pixels have lines twice as far
/// apart, single pixels say little more than their means: windows would see no line between two of
/// them, filters of a line's width would miss the weak ones, and each stage would take four times
/// as long.
struct CoarseView {
  Rig rig;  ///< with coarse cameras; lengths in their footprints
  Frame frame;
  FrameOptions options;
  double unit = 1;           ///< footprints of the rig seen, in one of this one's
  std::vector<int> binning;  ///< per camera: pixels along a row that are one
  std::vector<std::size_t> overexposed_pixels;  ///< per camera, before they were joined
};

/// Nothing where lines are not that far apart. `rig` in footprints.
[[nodiscard]] std::optional<CoarseView> coarse_view(const Rig& rig, const Frame& frame,
                                                    const FrameOptions& options);

/// A result of a coarse view in pixels and footprints of the rig that it is of. Curves and points
/// lie a pixel apart again: between two of them that follow each other, others are put on the
/// straight line. (Curves are fitted to profiles averaged over nine pixels along them.) Presence
/// images go.
[[nodiscard]] FrameResult in_fine_pixels(const CoarseView& view, FrameResult result);

/// An image (of float) whose pixel (u, v) is the mean around pixel (n u, n v), n = binning >= 1: of
/// n x n pixels where n is odd, else of n + 1 along a row and a column, the outer ones half.
[[nodiscard]] cv::Mat binned(const cv::Mat& image, int binning);

/// The camera of such images, which are linear light.
[[nodiscard]] Camera binned(Camera camera, int binning);

/// All lengths of a result times `factor`.
void scale_lengths(double factor, ShapeResult& shape);

}  // namespace pencilscan
