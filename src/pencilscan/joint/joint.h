#pragma once

#include <span>
#include <vector>

#include "pencilscan/joint/joint_options.h"
#include "pencilscan/labeling/labeling.h"

namespace pencilscan {

/// Decides (projector, line) or "undecided" for short pieces of all curves of all cameras together,
/// over discrete labels.
///
/// Energy: colour code and slant of each piece; crossings, whose two planes must meet in one point
/// of the ray (also for two projectors of one colour); continuity along a curve; the same line seen
/// by other cameras. Minimised by message passing within each camera; what the cameras say of each
/// other enters between two passes.
[[nodiscard]] Labeling solve_joint(const Rig& rig, const std::vector<ColorFamily>& families,
                                   std::span<const GridGraph> graphs, const JointOptions& options);

}  // namespace pencilscan
