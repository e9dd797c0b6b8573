#pragma once

#include "pencilscan/gray/gray_decode.h"

namespace pencilscan {

/// Two valid neighbours, up to a few pixels apart, whose codes may be of one piece of surface.
[[nodiscard]] bool neighbors_agree(const DecodedView& view, cv::Point a, cv::Point b,
                                   double steepest_code);

/// Fills in the crossings of a decoded view.
///
/// What a camera sees of an edge at x0 on a surface of uneven brightness E is blurred after E has
/// weighed it: the difference image is G * (E s), s odd about x0 (however blurred the projector
/// is). With E = E0 (1 + g (x - x0)) and a Gaussian G of deviation b it is zero at x0 - b^2 g:
/// edges shift towards the dark, by up to a few hundredths of a pixel where surfaces turn away from
/// the light, and outwards in the image on most objects, which a rig would take for lens
/// distortion. So crossings are moved back by b^2 g, g = d ln(white - black) / dx, and E is taken
/// out before the zero between two pixels is found on a straight line. b is read off the edges of
/// wide stripes: those that look sharpest have least of the projector's blur, which does not count.
void find_crossings(const GrayStack& stack, const GrayDecodeOptions& options, DecodedView& view);

}  // namespace pencilscan
