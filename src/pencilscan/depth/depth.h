#pragma once

#include <array>
#include <span>
#include <vector>

#include "pencilscan/depth/consistency.h"
#include "pencilscan/depth/dense_depth.h"
#include "pencilscan/detection/detect.h"
#include "pencilscan/geometry/ray_scene.h"
#include "pencilscan/uncertainty/exposure_motion.h"

namespace pencilscan {

struct DepthStageOptions {
  bool enabled = true;  ///< off: the surface rests on the labelled curves alone
  DepthOptions depth;
  ConsistencyOptions consistency;
};

/// What the depth stage found in one camera.
struct CameraDepthReport {
  int camera = 0;
  std::size_t measured = 0;  ///< nodes
  double blur_px = 0;        ///< of projector, surface and camera together
  double sigma_median_mm = 0;
};

struct DepthReport {
  std::vector<CameraDepthReport> cameras;
  ConsistencyReport consistency;
  std::size_t completed = 0;  ///< nodes found from the closed surface
};

struct DepthResult {
  std::vector<DepthMap> maps;       ///< one per camera with an image, in the rig's order
  std::vector<CameraLight> lights;  ///< one per map; they point to the rig's cameras
  DepthReport report;
};

/// Dense depth of one frame. Around each node of a pixel grid, inverse depth is a quadric that is
/// fitted to the image of all lit projectors at once (window_fit.h), started from labelled curve
/// points or from solved neighbours; then the cameras check each other (consistency.h). `images` as
/// read, one per camera of the rig (empty: missing); `detections` of them, whose presence images
/// the maps' lights share. `background`: points of named lines where the object cannot be, of all
/// cameras; windows that they explain as well show them.
[[nodiscard]] DepthResult measure_depth(const Rig& rig, const std::vector<ColorFamily>& families,
                                        std::span<const cv::Mat> images,
                                        std::span<const CameraDetection> detections,
                                        std::span<const MeasuredPoint> points,
                                        const DepthStageOptions& options = {},
                                        std::span<const MeasuredPoint> background = {});

/// How the object moved within the exposure, from the blur of the lines on the measured surface
/// (line_blur.h). `result`: with its lights.
[[nodiscard]] ExposureMotion motion_in_exposure(const Rig& rig, const DepthStageOptions& options,
                                                const DepthResult& result);

/// Guided depth: windows of nodes without depth are fitted once more, started from the closed
/// surface. Growth from neighbours does not cross a gap; the surface bridges it. A patch that no
/// other camera confirmed enters only if it agrees with the surface. Only what the images show
/// (dense_depth.h) is added to the maps of `result`. `surface`: in world coordinates, mm.
/// `background` as above.
void guided_depth(const Rig& rig, const RayScene& surface, const DepthStageOptions& options,
                  std::span<const MeasuredPoint> background, DepthResult& result);

}  // namespace pencilscan
