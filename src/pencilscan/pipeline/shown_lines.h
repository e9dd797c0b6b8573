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

  /// Right pictures of scenes that experiments/drawn_rigs.py draws have .60 and more (.46 where
  /// lines are three pixels apart), wrong ones .45 and less (a horse), mostly .38.
  [[nodiscard]] bool fits() const { return tells() && share() >= 0.5; }
  [[nodiscard]] bool misfits() const { return tells() && share() < 0.45; }

  [[nodiscard]] bool tells() const { return near >= 25; }  ///< the share's deviation is .1

 private:
  [[nodiscard]] double share() const { return static_cast<double>(on) / static_cast<double>(near); }
};

/// Of the curves of one camera. `points`: what each camera measured, with their deviations; used is
/// what is known to half a pixel of this camera.
[[nodiscard]] ShownLines shown_lines(const Rig& rig, const std::vector<ColorFamily>& families,
                                     const GridGraph& graph,
                                     std::span<const std::vector<MeasuredPoint>> points);

}  // namespace pencilscan
