#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "pencilscan/grid/grid_graph.h"
#include "pencilscan/labeling/measured_point.h"
#include "pencilscan/rig/rig.h"
#include "pencilscan/view/color_family.h"

namespace pencilscan {

/// Where a camera's curves lie beside points of other cameras that it should see. What hides such a
/// point shows other lines or none, mostly farther away than three pixels; chance has a third of
/// the others within one pixel, and up to .7 where lines are three pixels apart.
struct ShownLines {
  std::size_t near = 0;  ///< points with a curve of their colours within 3 px
  std::size_t on = 0;    ///< of these, within 1 px

  /// Enough of them to tell a right picture from chance: the share's deviation is .1.
  [[nodiscard]] bool tell() const { return near >= 25; }
  /// Right pictures of scenes that experiments/drawn_rigs.py draws have .60 and more (.46 where
  /// lines are three pixels apart), moved ones .38 and less.
  [[nodiscard]] bool fit() const {
    return static_cast<double>(on) >= 0.42 * static_cast<double>(near);
  }
};

/// Of the curves of one camera. `points`: what each camera measured, with their deviations; used is
/// what is known to half a pixel of this camera.
[[nodiscard]] ShownLines shown_lines(const Rig& rig, const std::vector<ColorFamily>& families,
                                     const GridGraph& graph,
                                     std::span<const std::vector<MeasuredPoint>> points);

}  // namespace pencilscan
