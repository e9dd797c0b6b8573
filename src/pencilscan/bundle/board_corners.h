#pragma once

#include "pencilscan/bundle/bundle.h"

namespace pencilscan {

/// A corner of a board, in world.
[[nodiscard]] Vec3 corner_point(const BundleProblem& problem, const BoardView& view);

/// From where the device sees a corner to where it should, px; very long for what it cannot see.
[[nodiscard]] Vec2 corner_error(const BundleProblem& problem, const BoardView& view);

/// Gives corners the deviation that their scatter shows, three times as large: boards are never
/// quite flat, and neighbouring corners err alike.
void weigh_corners(BundleProblem& problem);
/// Drops the corners beyond `deviations` times their robust scatter, half a pixel at least.
void drop_corners(BundleProblem& problem, double deviations);

/// Some board is seen by two devices or more: then it is a part of the rig, and its size gives the
/// scale.
[[nodiscard]] bool boards_join_devices(const std::vector<BoardView>& views);

/// Root mean square reprojection error of the corners, px; 0 without boards.
[[nodiscard]] double board_rms_px(const BundleProblem& problem);

}  // namespace pencilscan
