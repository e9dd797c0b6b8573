#pragma once

#include <opencv2/core.hpp>

#include "pencilscan/report/palette.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// Mean of a projector's pattern colours, made strong enough to be seen on a light ground; grey
/// where it has no pattern.
[[nodiscard]] Color light_color(const Projector& projector);

/// Draws the frusta of all devices, `size_mm` deep, that lie farther from the view than `depth_mm`
/// (or nearer, with in_front): cameras dark, projectors in the colour of their light. CV_8UC3 RGB.
void draw_devices(const Rig& rig, const Device& view, double size_mm, double depth_mm,
                  bool in_front, cv::Mat& picture);

}  // namespace pencilscan
