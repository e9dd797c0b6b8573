#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "pencilscan/detection/curve.h"
#include "pencilscan/detection/ridge.h"

namespace pencilscan {

struct TraceOptions {
  double max_turn_rad = 0.45;  ///< between neighbouring ridgels
  double max_gap_px = 6;       ///< bridged between chains that point at each other; >= 0
  int min_points = 6;          ///< shorter chains are dropped
};

/// Links ridgels into curves: each end of a ridgel chooses its best continuation, links chosen by
/// both sides are kept, chains that end face to face across a small gap are joined. Positions and
/// normals only; refine_curves() measures the rest.
[[nodiscard]] std::vector<Curve> trace_curves(std::span<const Ridgel> ridgels, cv::Size image_size,
                                              const TraceOptions& options = {});

}  // namespace pencilscan
