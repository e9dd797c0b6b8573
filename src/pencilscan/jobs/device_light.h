#pragma once

#include <span>

#include "pencilscan/jobs/frame_rows.h"

namespace pencilscan {

/// Tells less light of a projector from less light that a camera takes in. The height of the lines
/// of projector p in camera c is light_c light_p h_cp, with an h_cp that stays as long as the scene
/// does. So the logarithm of a height over its median in the sequence is a_c + b_p: b_p the median
/// over cameras, a_c the median over projectors of what is left. Of two middle values the one
/// nearer to no change counts: of two cameras, one that takes in less does not accuse projectors.
/// What changes alike in all cameras is said of the projectors. Fills FrameRow::device_light of all
/// rows with exp(a_c) and exp(b_p); unknown where no height is known.
void find_device_light(std::span<FrameRow> rows, const SequenceDevices& devices);

}  // namespace pencilscan
