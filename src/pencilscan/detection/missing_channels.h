#pragma once

#include <opencv2/core/types.hpp>
#include <vector>

#include "pencilscan/detection/curve.h"
#include "pencilscan/view/color_family.h"

namespace pencilscan {

/// Of a coloured surface a line may lack a channel: where nothing gives back green, a cyan line is
/// blue, and a yellow one red. So a blue line says less of its name than a cyan one does. How much
/// it says is told by the lines around: a code has both symbols alike often, so where a surface
/// gives back green, half of the lines show it.
///
/// Curve::code of a point that looks like colour k becomes, for a colour j that looks so without
/// some of its channels, (1 - P) L_j + P L_k: P is the probability that these channels are missing
/// there, by the lines of this family within some spacings, and before them the share of the
/// picture's places where they are missing (found in turns, as expectation-maximisation does).
/// `curves`: of one camera, whose image has `size`; lines are `spacing_px` apart.
void allow_for_missing_channels(const std::vector<ColorFamily>& families, cv::Size size,
                                double spacing_px, std::vector<Curve>& curves);

}  // namespace pencilscan
