#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "pencilscan/recording/frame_sets.h"

namespace pencilscan {

/// Gives the pictures of camera c that have no time stamp to the sets between those of the timed
/// ones around them, where these sets are as many and hold nothing of the camera, and notes the
/// others as left out (CameraClock::left_out). `set_of`: per row of the camera the set of its timed
/// picture.
void place_untimed(const ShotTimes& camera, std::size_t c,
                   const std::vector<std::optional<std::size_t>>& set_of, FrameSets& result);

}  // namespace pencilscan
