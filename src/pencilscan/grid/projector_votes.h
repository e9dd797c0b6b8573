#pragma once

#include <vector>

#include "pencilscan/grid/grid_graph.h"

namespace pencilscan {

/// Which pencil of planes does each curve belong to? Several projectors may share its colours. Each
/// crossing with a curve of another projector supports those (pattern, line) hypotheses whose depth
/// on the crossing's ray agrees with a line of the other curve, by
///   log( N(dz; 0, sigma) / density of chance agreements ), limited below at 0;
/// a curve sums its crossings per (pattern, line), and the best line speaks for the pattern.
/// Fills CurveIdentity::pattern.
void vote_for_projectors(const Rig& rig, const std::vector<ColorFamily>& families,
                         const GridOptions& options, GridGraph& graph);

}  // namespace pencilscan
