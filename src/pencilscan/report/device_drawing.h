#pragma once

#include <opencv2/core.hpp>

#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// Draws the frusta of all devices, `size_mm` deep, that lie farther from the view than `depth_mm`
/// (or nearer, with in_front): cameras dark, projectors in the colour of their light. CV_8UC3 RGB.
void draw_devices(const Rig& rig, const Device& view, double size_mm, double depth_mm,
                  bool in_front, cv::Mat& picture);

}  // namespace pencilscan
