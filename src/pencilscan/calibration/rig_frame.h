#pragma once

#include "pencilscan/calibration/calibrate.h"

namespace pencilscan {

/// Moves the solution by a similarity: x_new = scale * rotation * x + translation.
void move_solution(double scale, const RigidTransform& new_from_old, BundleProblem& problem);
/// Puts the solution into the frame of the given poses; without these, into one of its own: origin
/// in the middle of the points, z against the cameras' mean "down", and the scale of the known
/// distance, of the board, or none (mean distance of the devices = 1000).
struct FixedFrame {
  bool is_scaled = false;  ///< the scale is known
  double of_given = 1;     ///< what lengths in the frame of the given poses are multiplied by
};
FixedFrame fix_frame(const CalibrationInput& input, BundleProblem& problem);

}  // namespace pencilscan
