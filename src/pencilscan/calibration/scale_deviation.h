#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/bundle/uncertainty.h"
#include "pencilscan/calibration/calibrate.h"

namespace pencilscan {

/// How well lengths in the volume are known: one standard deviation of the rig's scale there, as a
/// share. A rig whose shape is known weakly has none that is good, however exact the length that
/// was given: how a distance of devices goes together with the volume is part of its shape.
struct ScaleDeviation {
  enum class From { kDistance, kBoard, kPoses };
  From from = From::kDistance;
  std::vector<std::size_t> devices;  ///< whose distance or poses give the scale
  double share = 0;
};

/// Of the scale that the result has; that of a distance counts as exact, a board has the errors of
/// its shape, given poses those that their scatter shows. Nothing where the unit is unknown, and
/// where no two devices see the same board: the covariance does not know that scale.
[[nodiscard]] std::optional<ScaleDeviation> scale_deviation(const CalibrationInput& input,
                                                            const CalibrationResult& result,
                                                            const Uncertainty& uncertainty);

/// Of the same rig, were the distance of two devices the one that is given: those with which it is
/// smallest. Nothing with fewer than two.
[[nodiscard]] std::optional<ScaleDeviation> best_distance(const CalibrationResult& result,
                                                          const Uncertainty& uncertainty);

}  // namespace pencilscan
