#pragma once

#include <span>
#include <vector>

#include "pencilscan/depth/background_view.h"
#include "pencilscan/depth/depth_map.h"
#include "pencilscan/depth/pilot_light.h"
#include "pencilscan/depth/window_fit.h"
#include "pencilscan/geometry/ray_scene.h"
#include "pencilscan/labeling/measured_point.h"
#include "pencilscan/view/color_family.h"

namespace pencilscan {

struct DepthOptions {
  int stride = 4;              ///< px between nodes, in [1, 8]
  int half = 5;                ///< radius of a window, px, in [2, 10]
  int narrow_half = 5;         ///< where that does not fit: px, in [2, half]
  double seed_radius_px = 10;  ///< around a node: labelled points that it may start from
  double max_misfit = 8;       ///< chi^2 per degree of freedom
  /// Root mean square over the largest amplitude; or twice the usual one (JPEG), if that is more.
  double max_relative_residual = 0.25;
  double max_sigma_lines = 0.08;  ///< deviation of the depth, lines of the best pattern
  double min_cosine = 0.2;        ///< of the incidence to the camera, in [0, 1]
  double max_move = 2;            ///< footprints; of a node started from the closed surface
  double max_move_lines = 0.16;   ///< line spacings, if that is more
};

/// The options as they are for one camera's pictures: windows behind a mosaic are wider, and so are
/// those of wide lines. What noise makes wider is tried as it was where it does not fit.
[[nodiscard]] DepthOptions options_for(const CameraLight& light, DepthOptions options);

/// Evenly picked labelled points of a camera.
[[nodiscard]] std::vector<PilotWindow> pilot_windows(const CameraLight& light, int camera,
                                                     std::span<const MeasuredPoint> points,
                                                     const DepthOptions& options);
/// Evenly picked nodes that see a measured part of `surface`, for a camera without labels.
[[nodiscard]] std::vector<PilotWindow> pilot_windows(const CameraLight& light,
                                                     const RayScene& surface, const DepthMap& map,
                                                     const DepthOptions& options);

/// The depth map of camera `camera` (index in the rig), one node every options.stride px. Windows
/// of nodes near labelled curve points start from these; grow() goes on from there; then narrow
/// windows of nodes that have no depth. Of `points`, those of this camera count. What lies outside
/// the object's space has no depth, nor has a window that the background explains as well.
[[nodiscard]] DepthMap dense_depth(const CameraLight& light, int camera,
                                   std::span<const MeasuredPoint> points,
                                   const Background& background, const DepthOptions& options);

/// Outwards from nodes with depth, in rounds: the windows of their neighbours start from them.
void grow(const CameraLight& light, const Background& background, const DepthOptions& options,
          DepthMap& map);

/// Fits the windows, then the narrow ones, of nodes without depth whose rays meet `surface`. Each
/// fit starts from the surface's tangent plane. It is kept if it ends near the surface; a fit that
/// is off by a line does not end there. sigma is multiplied by `sigma_factor`. Returns the number
/// of nodes that got depth.
std::size_t complete_map(const CameraLight& light, const RayScene& surface,
                         const Background& background, double sigma_factor,
                         const DepthOptions& options, DepthMap& map);

}  // namespace pencilscan
