#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "pencilscan/detection/curve.h"

namespace pencilscan {

/// Where two detected curves of one camera intersect.
struct Crossing {
  int curve_a = 0;
  int curve_b = 0;  ///< > curve_a
  float at_a = 0;   ///< position along a: fractional point index
  float at_b = 0;
  Eigen::Vector2f position = Eigen::Vector2f::Zero();  ///< camera pixel
  float sigma_px = 0;  ///< root of the mean variance of the position
};

/// All intersections of curves that meet at more than `min_angle_rad`, from their local directions;
/// ordered by (curve_a, at_a). Curves of one family count too (two projectors of one colour).
[[nodiscard]] std::vector<Crossing> find_crossings(std::span<const Curve> curves,
                                                   cv::Size image_size,
                                                   double min_angle_rad = 0.26);

}  // namespace pencilscan
