#pragma once

#include <span>
#include <string>
#include <vector>

#include "pencilscan/pipeline/frame.h"

namespace pencilscan {

/// How plainly lines stand out in the picture of each camera, of what is usual in the others': the
/// energy of light that changes at the lines' period, of all light, over the median of the others.
/// 1 without a picture or without others. A camera of coarser pixels is asked at its own period.
///
/// A blur of deviation s takes exp(-4 (pi s / period)^2) of that energy: .11 where s is a quarter
/// of the period.
[[nodiscard]] std::vector<double> line_contrasts(const Rig& rig, const Frame& frame);

/// Whether a camera is out of focus, by its contrast. Of 1812 pictures (364 scenes: other rigs,
/// rooms, renderers, projectors out of focus) right ones have .25 and more, those that were blurred
/// by 2 px and more of a period of 6 to 12 px .046 and less.
[[nodiscard]] constexpr bool is_out_of_focus(double contrast) { return contrast < 0.125; }

/// How many times less its lines stand out, in words: "4.2 times less".
[[nodiscard]] std::string times_less(double contrast);

/// The cameras that are out of focus. `graphs`: their curves; contrast is asked only of pictures
/// whose lines are few, or dim, beside the others'.
[[nodiscard]] std::vector<Warning> focus_warnings(const Rig& rig, const Frame& frame,
                                                  std::span<const GridGraph> graphs);
/// What else is said of a camera out of focus comes of that.
void let_focus_explain(std::vector<Warning>& warnings);

}  // namespace pencilscan
