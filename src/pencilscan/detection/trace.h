#pragma once

#include <cstddef>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "pencilscan/detection/curve.h"
#include "pencilscan/detection/ridge.h"

namespace pencilscan {

struct TraceOptions {
  double max_turn_rad = 0.45;  ///< between neighbouring ridgels
  double max_gap_px = 6;       ///< bridged between chains that point at each other, in pixels of
                               ///< the image that shows them best; >= 0
  int min_points = 6;          ///< shorter chains are dropped
};

/// Links ridgels into curves: each end of a ridgel chooses its best continuation, links chosen by
/// both sides are kept, chains that end face to face across a small gap are joined. Ridgels of one
/// scale are linked in pixels of their image, then chains of all scales are joined; points lie
/// about 1 px apart. Positions and widths only; refine_curves() measures the rest.
[[nodiscard]] std::vector<Curve> trace_curves(std::span<const Ridgel> ridgels, cv::Size image_size,
                                              const TraceOptions& options = {});

/// Chains of three or more ridgels of one scale, by index.
[[nodiscard]] std::vector<std::vector<std::size_t>> link_ridgels(std::span<const Ridgel> ridgels,
                                                                 cv::Size image_size,
                                                                 const TraceOptions& options = {});

}  // namespace pencilscan
