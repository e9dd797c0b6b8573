#pragma once

#include <span>
#include <vector>

#include "pencilscan/io/point_file.h"
#include "pencilscan/solution/labeling.h"

namespace pencilscan {

struct TriangulationOptions {
  double volume_margin = 1.1;        ///< points farther out than this many radii are dropped
  double projection_sigma_px = 0.1;  ///< error of the projector model across the line
};

/// Camera ray meets light sheet, for every pixel of every labelled curve. sigma: position noise and
/// projector error, carried along the ray by the slope of the line coordinate. At most one point
/// per (camera, projector, pattern, line, pixel): the most certain one.
[[nodiscard]] std::vector<MeasuredPoint> triangulate(const Rig& rig,
                                                     std::span<const GridGraph> graphs,
                                                     const Labeling& labeling,
                                                     const TriangulationOptions& options = {});

}  // namespace pencilscan
