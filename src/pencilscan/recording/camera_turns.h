#pragma once

#include <cstddef>
#include <vector>

namespace pencilscan {

/// A picture with its time by the common clock.
struct TimedShot {
  double time_ns = 0;  ///< after the first picture of the reference
  std::size_t camera = 0;
  std::size_t row = 0;
};

/// Splits the sets of cameras that take turns, most of which have the same two halves, into two
/// each (frame_sets.h says when). `sets`: in order of time, and so are the shots of each; `period`:
/// ns from picture to picture of a camera.
void split_turns(std::vector<std::vector<TimedShot>>& sets, double period);

}  // namespace pencilscan
