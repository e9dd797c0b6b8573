#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "pencilscan/capture/camera_device.h"

namespace pencilscan {

/// What a picture says of exposure and focus, while somebody turns rings. Shares in [0, 1].
struct LiveFigures {
  double brightest = 0;      ///< of the range: one pixel in a thousand is brighter
  double saturated = 0;      ///< share of the pixels with a colour at the end of the range
  double lit = 0;            ///< share of the pixels above a fifth of the brightest; 0: too dark
  double edge_px = 0;        ///< width of the edges; 0: there are none
  double line_contrast = 0;  ///< (bright - dark) / (bright + dark) within 16 px where it is lit;
                             ///< 0: too dark
};

/// Edges: an edge of height h that rises evenly over w px, w <= 8, adds up to h^2 (8 - w / 3) in
/// the squared changes over 8 px, at all places, and to h^2 / w in those of neighbours: their ratio
/// gives w. Only places where light changes by more than a tenth of the brightest within 8 px
/// count. Where the brightest is above `black_level` by less than what makes a fifth of it more
/// than noise, nothing is said of what is lit. Mosaics are looked at in cells of 2 x 2; widths are
/// given in pixels. Of large pictures every n-th row is looked at.
[[nodiscard]] LiveFigures live_figures(const CameraFrame& frame, double black_level = 0);

/// What to turn, most urgent first; empty: nothing. `lines`: the projectors show their lines.
[[nodiscard]] std::vector<std::string> advice_for(const LiveFigures& figures, bool lines);

/// As a person looks at it: 8U, RGB or grey, at most `width` wide; a mosaic in colour.
[[nodiscard]] cv::Mat preview_of(const CameraFrame& frame, int width);
/// The same as the bytes of a JPEG file.
[[nodiscard]] std::string preview_jpeg(const CameraFrame& frame, int width);

}  // namespace pencilscan
