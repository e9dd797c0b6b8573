#pragma once

#include <vector>

#include "pencilscan/detection/curve.h"

namespace pencilscan {

/// Places points on a local parabola through their four neighbours to either side, and sets the
/// normals.
void smooth_positions(std::vector<CurvePoint>& points);

/// Running median of nine widths: the width varies slowly, single fits trade it against the
/// background.
void smooth_widths(std::vector<CurvePoint>& points);

}  // namespace pencilscan
