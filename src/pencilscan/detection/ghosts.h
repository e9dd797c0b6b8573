#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "pencilscan/detection/curve.h"

namespace pencilscan {

/// Without ghosts: ridges along the diagonals of a lattice that lines of one family make, from
/// bright crossing to bright crossing, with dark between. Light only adds, so along a true line the
/// presence is everywhere that line's own height at least; along a diagonal a fifth of the way or
/// more lies in the dark, where lines take less than two fifths of their pitch. A place is a ghost
/// where, within eight widths of the line along the curve, the lower fifth of the presence is less
/// than two fifths of the height (means over a width to either side, for noise). What is left is
/// kept in pieces of at least `min_points`. `curves`: refined, in pixels of `presence`.
[[nodiscard]] std::vector<Curve> without_ghosts(const cv::Mat& presence, std::vector<Curve> curves,
                                                int min_points);

}  // namespace pencilscan
