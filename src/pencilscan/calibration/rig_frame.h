#pragma once

#include "pencilscan/calibration/calibrate.h"

namespace pencilscan {

/// Moves the solution by a similarity: x_new = scale * rotation * x + translation.
void move_solution(double scale, const RigidTransform& new_from_old, BundleProblem& problem);

struct FixedFrame {
  bool is_scaled = false;  ///< the scale is known
  bool is_given = false;   ///< it is the frame of the given poses
  double of_given = 1;     ///< what lengths in the frame of the given poses are multiplied by
  bool contradicts_given = false;  ///< these were in millimetres, and `of_given` is not 1
  /// What the known distance makes of the board's millimetres, where the two contradict each other.
  std::optional<double> of_board;
};
/// Puts the solution into the frame of three or more given poses; without these, into one of its
/// own: origin in the middle of the points, z against the cameras' mean "down". The scale is that
/// of the known distance; else of the board; else of given poses; else none (mean distance of the
/// devices = 1000). Given millimetres that a measured scale contradicts are multiplied by what it
/// makes of them.
FixedFrame fix_frame(const CalibrationInput& input, BundleProblem& problem);

}  // namespace pencilscan
