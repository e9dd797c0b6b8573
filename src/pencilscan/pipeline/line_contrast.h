#pragma once

#include <span>
#include <string>
#include <vector>

#include "pencilscan/pipeline/frame.h"

namespace pencilscan {

/// How plainly lines stand out in the picture of each camera, of what is usual in the others': the
/// energy of light that changes at the lines' period, of all light, over the median of two others
/// or more. 1 where that cannot be told: without a picture or two others, for cameras of texture,
/// where lines lie less than three pixels apart, and where `left_out` is 1. A camera of coarser
/// pixels is asked at its own period.
///
/// A blur of deviation s takes exp(-4 (pi s / period)^2) of that energy: .085 where s is a quarter
/// of the period.
[[nodiscard]] std::vector<double> line_contrasts(const Rig& rig, const Frame& frame,
                                                 std::span<const char> left_out);

/// Whether a camera is out of focus, by its contrast. Of 1812 pictures (364 scenes: other rigs,
/// rooms, renderers, projectors out of focus) right ones have .25 and more, those that were blurred
/// by a third of the period and more .046 and less.
[[nodiscard]] constexpr bool is_out_of_focus(double contrast) { return contrast < 0.125; }

/// How many times less its lines stand out, in heights, in words: "4.2 times less".
[[nodiscard]] std::string times_less(double contrast);

/// The cameras that are out of focus; of a frame whose plainly wrong pictures were left out.
/// Contrast is asked only of pictures whose lines are few, or dim, beside the others'.
[[nodiscard]] std::vector<Warning> focus_warnings(const Rig& rig, const Frame& frame,
                                                  const PointResult& curves);
/// What else is said of a camera out of focus comes of that.
void let_focus_explain(std::vector<Warning>& warnings);

}  // namespace pencilscan
