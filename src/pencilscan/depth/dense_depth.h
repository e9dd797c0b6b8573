#pragma once

#include <span>
#include <vector>

#include "pencilscan/depth/depth_map.h"
#include "pencilscan/depth/window_fit.h"
#include "pencilscan/detection/color_family.h"
#include "pencilscan/io/point_file.h"

namespace pencilscan {

struct DepthOptions {
  int stride = 4;  ///< px between nodes, in [1, 8]
  int half = 5;    ///< radius of a window, px, in [2, 10]
  double seed_radius_px = 10;
  double max_misfit = 8;  ///< chi^2 per degree of freedom
  double max_relative_residual = 0.25;
  double max_sigma_lines = 0.08;  ///< of the best pattern
  double min_cosine = 0.2;        ///< of the incidence to the camera
};

/// Light as one camera sees it, blur and noise measured from the image itself at the seeds.
[[nodiscard]] CameraLight measure_light(const Rig& rig, int camera,
                                        const std::vector<ColorFamily>& families,
                                        std::vector<cv::Mat> presence, cv::Mat valid,
                                        std::span<const MeasuredPoint> points,
                                        const DepthOptions& options);

[[nodiscard]] DepthMap dense_depth(const CameraLight& light, int camera,
                                   std::span<const MeasuredPoint> points, const Sphere& volume,
                                   const DepthOptions& options);

}  // namespace pencilscan
