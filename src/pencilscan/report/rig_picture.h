#pragma once

#include <opencv2/core.hpp>

#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// A drawing of the rig to scale, from above (x to the right, y up) and from the side (x to the
/// right, z up), both parallel projections: devices with their names, what each sees as far as the
/// middle of the working volume, the volume, and a bar of length. CV_8UC3 RGB, each view
/// `side_px` x `side_px`.
[[nodiscard]] cv::Mat draw_rig(const Rig& rig, int side_px = 900);

}  // namespace pencilscan
