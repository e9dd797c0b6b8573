#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "pencilscan/depth/depth_map.h"
#include "pencilscan/depth/window_fit.h"
#include "pencilscan/uncertainty/exposure_motion.h"

namespace pencilscan {

/// The lines of one pattern around a node of a depth map.
struct NodeLines {
  std::size_t node = 0;
  std::size_t pattern = 0;  ///< of the camera's light
  LineBlur blur;
};

/// Of every `stride`-th node of every `stride`-th row, whose neighbours are all measured: elsewhere
/// the surface may end within the window. Their variance is that of the light's blur_px, their
/// deviation infinite. Lines less than 3 px apart are left out, with their windows: they show
/// little but their mean.
[[nodiscard]] std::vector<NodeLines> lines_at_nodes(const Rig& rig, const CameraLight& light,
                                                    const DepthMap& map, int stride);

/// Measures the blur of lines that lines_at_nodes() gave, at least of whole windows. The light of a
/// window is that of window_fit.h on the surface that the node has, but its lines are blurred by a
/// Gaussian (render_gaussian_lines()). One step of Gauss-Newton starts from the variance that the
/// lines have; the blur of each pattern is unknown in it beside surface, amplitudes, offset and
/// slopes of the light. `half`: radius of a window, px. What cannot be measured keeps an infinite
/// deviation.
void measure_blurs(const CameraLight& light, const DepthMap& map, int half,
                   std::span<NodeLines> lines);

/// How many windows of such nodes see a pixel, weighted as they are.
[[nodiscard]] double window_overlap(const DepthMap& map, int half, int stride);

}  // namespace pencilscan
