#pragma once

#include <Eigen/Core>
#include <span>

#include "pencilscan/refinement/correction.h"
#include "pencilscan/refinement/crossing_tracks.h"

namespace pencilscan {

/// The seven ways to move all devices that no crossing can see, 6 devices x 7 in units of
/// PoseCorrection (rotation_px, translation_mm per device): rotation (rad) and translation (mm) of
/// the world about `center`, and its growth. With y = R X + t and the centre at y_c, the motion
/// X' = X + r x (X - c) + t + s (X - c) is made good by w = -R r, d = -w x y_c - R t + s y_c.
[[nodiscard]] Eigen::MatrixXd gauge_directions(const Rig& rig, const Vec3& center);

/// Root mean square error of the line coordinate on the camera rays of the tracks, projector px,
/// for corrections with this covariance (6 devices square). Motions of the whole rig do not count.
/// prior_precision: diagonal, which of equal corrections is meant.
[[nodiscard]] double line_error_px(const Rig& rig, std::span<const CrossingTrack> tracks,
                                   const Eigen::MatrixXd& covariance,
                                   const Eigen::VectorXd& prior_precision);

}  // namespace pencilscan
