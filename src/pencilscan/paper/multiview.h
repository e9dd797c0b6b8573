#pragma once

#include <span>
#include <vector>

#include "pencilscan/labeling/labeling.h"
#include "pencilscan/paper/linear.h"
#include "pencilscan/paper/reprojection.h"

namespace pencilscan {

enum class MultiviewCost {
  /// The paper's: sum over the points that fall into another image. A point that meets no curve
  /// within the search radius, which the paper does not have, counts as that radius.
  kPublished,
  kNormalized,  ///< mean over all points, those outside the other images counting as the radius
};

struct MultiviewOptions {
  MultiviewCost cost = MultiviewCost::kNormalized;
  double search_radius_px = 8;  ///< reprojected point to detected curve; > 0
  double step_lines = 0.25;     ///< sweep step of the most moving curve; > 0
  int point_stride = 3;         ///< every how many curve points are reprojected; >= 1
};

/// Multi-view correction of one component (section IV-B): x(s) = x0 + s e is swept over all
/// positions of the pattern planes in the volume (Step 1); each curve snaps to the nearest line
/// with its local ID (1.1); its points, triangulated with that line, are reprojected into the
/// adjacent cameras (1.2) and compared with the curves of the same ID there (1.3); the s of least
/// cost wins (Step 2).
///
/// What the comparison costs depends on a curve and its line only, not on s: it is computed once
/// per (curve, line), and the sweep adds up table entries.
/// Deviation: all cameras within 75 degrees count as adjacent, not one.
struct MultiviewSolution {
  std::vector<int>
      lines;  ///< per unknown of the linear solution; -1: its line is outside the volume
  ComponentReport report;  ///< sweep, margin
};

[[nodiscard]] MultiviewSolution sweep_component(const Rig& rig, const GridGraph& graph,
                                                const LinearSolution& linear,
                                                std::span<const CurveIndex> indices,
                                                const MultiviewOptions& options);

}  // namespace pencilscan
