#pragma once

#include <span>
#include <vector>

#include "pencilscan/labeling/labeling.h"
#include "pencilscan/labeling/measured_point.h"

namespace pencilscan {

struct TriangulationOptions {
  double volume_margin =
      1.1;  ///< points farther out than this many radii are dropped (rig/object_space.h)
  bool keeps_background = false;      ///< points behind the volume or on a stated floor stay
  double projection_sigma_px = 0.03;  ///< error of the projector model across the line
  // What the profile fit cannot see; measured on rendered bunny, hand and balls (the "sigma"
  // figures of `evaluate`).
  double position_factor = 2.2;     ///< real over fitted deviation: errors are alike along a curve
  double end_sigma_px = 0.5;        ///< more at the end of a curve, where its profile is cut ...
  double end_reach = 4;             ///< ... fading over so many points
  double footprint_sigma_px = 0.1;  ///< of the surface within a pixel, in pixel footprints
  int used_of_seven = 7;  ///< pixels of seven whose points are wanted (points/pixel_lattice.h)
};

/// Intersects camera ray and light sheet for every pixel of every labelled curve. sigma adds the
/// noise of the curve's position, the error of the projector and the footprint of a pixel; the
/// slope of the line coordinate carries them along the ray. Of several points of one (camera,
/// projector, pattern, line, pixel) only the most certain one is kept. Ordered by graph, then by
/// (projector, pattern, line, row, column).
[[nodiscard]] std::vector<MeasuredPoint> triangulate(const Rig& rig,
                                                     std::span<const GridGraph> graphs,
                                                     const Labeling& labeling,
                                                     const TriangulationOptions& options = {});

}  // namespace pencilscan
