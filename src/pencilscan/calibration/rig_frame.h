#pragma once

#include "pencilscan/calibration/calibrate.h"

namespace pencilscan {

/// Deviation of a distance that a tape measures between lenses, as a share: nobody sees their
/// pupils, which are centimetres deep.
inline constexpr double kTapeDeviation = 0.025;

/// Deviation of the scale of n given poses, as a share: that of a coordinate, which 3 n - 7 surplus
/// numbers show, over the poses' spread. Centres of devices, as found in the given frame and as
/// given; n >= 3.
[[nodiscard]] double pose_scale_deviation(const Eigen::Matrix3Xd& found,
                                          const Eigen::Matrix3Xd& given);

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
