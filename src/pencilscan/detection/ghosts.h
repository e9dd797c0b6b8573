#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "pencilscan/detection/curve.h"

namespace pencilscan {

/// Without ghosts: ridges that run across dense lines of one family, from bright place to bright
/// place with dark between. Light only adds, so along a true line the presence is everywhere that
/// line's own height at least; across lines that take less than two fifths of their pitch, a fifth
/// of the way or more is dark. A place is a ghost where, within eight widths of the line along the
/// curve, the lower fifth of the presence is less than two fifths of the height there. Both are
/// means: of the presence over a width to either side, for noise, of the height over three, which
/// are longer than the gaps and shorter than most textures. What is left is kept in pieces of at
/// least `min_points`. `curves`: refined, in pixels of `presence`.
[[nodiscard]] std::vector<Curve> without_ghosts(const cv::Mat& presence, std::vector<Curve> curves,
                                                int min_points);

}  // namespace pencilscan
