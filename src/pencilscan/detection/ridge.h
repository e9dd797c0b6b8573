#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace pencilscan {

/// A local piece of a bright line: a maximum across one direction of the oriented filter.
struct Ridgel {
  float x = 0, y = 0;     ///< sub-pixel position
  float nx = 1, ny = 0;   ///< unit normal
  float response = 0;     ///< negative second derivative across, smoothed along
  float width_px = 1.5F;  ///< first guess of the profile's Gaussian width
  float scale = 1;        ///< size of the image that shows it best: 1 / scale, a power of two
};

struct RidgeOptions {
  double sigma_across_px = 1.3;  ///< Gaussian scale across the line; > 0
  double sigma_along_px = 3.0;   ///< along it; > sigma_across_px
  int orientations = 12;         ///< >= 6
  double noise_factor = 5.0;     ///< threshold in standard deviations of the background's response
  double relative_threshold = 0.05;  ///< of the strong (99th percentile) response at any size
  double widest_px = 40;             ///< lines up to this width are found; > 0
  double usual_px = 0;               ///< width of most lines, as the rig states it; 0: not known
};

/// Ridgels of one presence image, in (x, y, direction) space: where two lines of one colour cross,
/// both directions have their own maximum, so that neither is lost. This replaces the image
/// rotation of the paper's section IV-C.
///
/// The elongated second-derivative filter is the isotropic Gaussian Hessian (sigma_across), steered
/// to each direction, and smoothed along it by a 1-D Gaussian of variance along^2 - across^2 on a
/// sheared grid: 2 multiplications a tap instead of a full 2-D kernel.
///
/// Lines of any width up to `widest_px` are found: the filter looks at the image at full, half,
/// quarter ... size, and the size with the strongest response wins (ridge_scales.h). Ridgels of the
/// image at 1 / n of its size lie about n px apart along their line.
[[nodiscard]] std::vector<Ridgel> find_ridgels(const cv::Mat& presence,
                                               const RidgeOptions& options = {});

/// Number of sizes of the image that these were found at, from the full one to the smallest.
[[nodiscard]] int sizes_of(const std::vector<Ridgel>& ridgels);

}  // namespace pencilscan
