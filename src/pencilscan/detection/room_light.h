#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "pencilscan/view/color_family.h"

namespace pencilscan {

// Light of the room (lamps, sun through a blind) falls on prints and stripes of an object, and they
// are taken for projected lines. Three laws tell it from projected light:
//   1. A projected line lacks one of the three channels; the room's light lacks none. What all
//      channels have is room light, or lies where lines of several colours cross.
//   2. Crossings are short. Room light fills straight pieces that are longer.
//   3. Lines are thin. What fills a disk as wide as the pitch is no line.
// By 1 and 2, the room's part of a pixel is the most that all channels have over a whole straight
// piece through it; 3 takes away what coloured surfaces make of it.

/// Whether every line of these families lacks a channel, which law 1 needs.
[[nodiscard]] bool lines_lack_a_channel(const std::vector<ColorFamily>& families);

/// Whether the room lights most of what lines light, with a tenth of their light or more, and shows
/// stripes or prints there: a plain surface gives it back evenly, and lines on it are found as in
/// the dark. `light`: unmixed, CV_32FC3; `pitch_px`: of neighbouring lines. Looks at a sample of
/// the picture.
[[nodiscard]] bool room_shows_prints(const cv::Mat& light, double pitch_px);

/// The picture without the room's light.
[[nodiscard]] cv::Mat without_room_light(const cv::Mat& light, double pitch_px);

}  // namespace pencilscan
