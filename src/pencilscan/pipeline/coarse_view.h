#pragma once

#include <optional>
#include <vector>

#include "pencilscan/pipeline/frame.h"

namespace pencilscan {

/// A frame as cameras of fewer pixels would see it, for a quicker and coarser result
/// (FrameOptions::joined_pixels).
struct CoarseView {
  Rig rig;  ///< with coarse cameras; lengths in their footprints
  Frame frame;
  FrameOptions options;
  double unit = 1;           ///< footprints of the rig seen, in one of this one's
  std::vector<int> binning;  ///< per camera: pixels along a row that are one
  std::vector<std::size_t> overexposed_pixels;  ///< per camera, before they were joined
};

/// Nothing where no pixels are to be joined. `rig` in footprints. Cameras of texture alone keep
/// theirs.
[[nodiscard]] std::optional<CoarseView> coarse_view(const Rig& rig, const Frame& frame,
                                                    const FrameOptions& options);

/// A result of a coarse view in pixels and footprints of the rig that it is of. Curves and points
/// lie a pixel apart again: between two of them that follow each other, others are put on the
/// straight line. (Curves are fitted to profiles averaged over nine pixels along them.) Presence
/// images go.
[[nodiscard]] FrameResult in_fine_pixels(const CoarseView& view, FrameResult result);

}  // namespace pencilscan
