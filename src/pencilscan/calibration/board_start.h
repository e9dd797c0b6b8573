#pragma once

#include "pencilscan/calibration/calibrate.h"

namespace pencilscan {

/// Focal lengths of cameras whose K is not given, from the boards they see (principal point in the
/// middle, square pixels; Z. Zhang, "A flexible new technique for camera calibration", 2000), into
/// the rig. Returns, per device, whether its K is given or was found here.
[[nodiscard]] std::vector<char> focal_lengths_from_boards(const CalibrationInput& input, Rig& rig);

/// Poses from boards alone, in mm: boards and cameras follow from each other, then projectors from
/// their correspondences on the boards (the homography of the plane gives pose and, where K is not
/// given, focal length and lens shift). `problem.devices` have inner parameters, no poses; those
/// found become present. For planar scenes, where fundamental matrices say nothing.
void place_by_boards(const CalibrationInput& input, const std::vector<char>& known,
                     BundleProblem& problem);

/// Poses of the boards in a structure whose scale means nothing; the structure gets the boards'
/// millimetres, from the depth of correspondences on them. The problem has no board
/// afterwards where none has enough of them.
void attach_boards(const CalibrationInput& input, BundleProblem& problem);

/// Adds projectors' views of boards that have poses: where a projector is part of the rig, the
/// board ties it to what the camera sees of it, size and all.
void add_projected_corners(const CalibrationInput& input, BundleProblem& problem);

/// The same once more for an adjusted structure, where every board is seen by one device only: then
/// nothing in the adjustment ties the structure's scale to the board's.
void rescale_to_boards(BundleProblem& problem);

}  // namespace pencilscan
