#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/labeling/measured_point.h"
#include "pencilscan/report/palette.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// A curve in an image: pixel positions (u, v) in order; one point alone is drawn as a dot.
struct OverlayCurve {
  std::vector<Eigen::Vector2f> points;
  int key = -1;  ///< local ID or projector index; negative: undecided, drawn in grey
};

struct OverlayOptions {
  double brightness = 0.45;           ///< of the image below the curves, in [0, 1]
  int zoom = 1;                       ///< output pixels per image pixel, in [1, 8]
  int thickness_px = 1;               ///< of a curve in output pixels, >= 1
  std::string key_name = "local ID";  ///< in the legend
  bool legend = true;                 ///< a strip below the picture
};

/// The image (CV_32FC3 RGB, linear in [0, 1], or CV_8UC3 RGB as shown) made dark, with the curves
/// drawn antialiased in the colour of their key. Result: CV_8UC3 RGB; image pixel (u, v) is at
/// (zoom u, zoom v) + (zoom - 1) / 2.
[[nodiscard]] cv::Mat draw_overlay(const cv::Mat& image, std::span<const OverlayCurve> curves,
                                   const OverlayOptions& options = {});

enum class OverlayKey { kLocalId, kProjector };

/// The measured points of one camera, chained into curves: neighbours on one line of one projector
/// up to 2.5 px apart. Points with used[i] == 0 get key -1; `used` is empty or as long as points.
[[nodiscard]] std::vector<OverlayCurve> curves_of_points(const Rig& rig,
                                                         std::span<const MeasuredPoint> points,
                                                         std::size_t camera, OverlayKey key,
                                                         std::span<const char> used = {});

/// 8-bit sRGB-like picture (gamma 2.2) of a linear float image, brightened where it fills less than
/// a sixteenth of the range (12 bits of 16); 8-bit images are copied.
[[nodiscard]] cv::Mat displayable(const cv::Mat& image);

}  // namespace pencilscan
