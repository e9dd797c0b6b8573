#pragma once

#include <span>
#include <vector>

#include "pencilscan/labeling/labeling.h"
#include "pencilscan/view/places.h"

namespace pencilscan {

/// A point of a curve that has a name.
struct RunPoint {
  std::size_t run;
  int point;  ///< of the run's curve
};

/// The points of one camera's named curves, by place. `runs`: the names of `curves`. `subtracted`:
/// per curve, whether it has light of its own; others are left out.
[[nodiscard]] Places<RunPoint> places_of_runs(const Camera& camera, std::span<const Curve> curves,
                                              std::span<const LabeledRun> runs,
                                              const std::vector<char>& subtracted);

}  // namespace pencilscan
