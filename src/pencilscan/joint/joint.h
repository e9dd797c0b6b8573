#pragma once

#include <span>
#include <vector>

#include "pencilscan/joint/joint_options.h"
#include "pencilscan/labeling/labeling.h"

namespace pencilscan {

/// Decides (projector, line) or "undecided" for short pieces of all curves of all cameras together,
/// over discrete labels.
///
/// The energy has these terms: colour code and slant of each piece (piece_labels.h); crossings,
/// whose two planes must meet in one point of the ray, also for two projectors of one colour;
/// continuity along a curve; smoothness (surroundings.h); the same line in other cameras
/// (other_views.h). Message passing within each camera minimises it (min_sum.h). The terms that
/// join cameras are added between two passes.
[[nodiscard]] Labeling solve_joint(const Rig& rig, const std::vector<ColorFamily>& families,
                                   std::span<const GridGraph> graphs, const JointOptions& options);

}  // namespace pencilscan
