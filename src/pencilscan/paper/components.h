#pragma once

#include <span>

#include "pencilscan/paper/multiview.h"
#include "pencilscan/paper/single_projector.h"

namespace pencilscan {

/// The paper's A: every component by equations (6) alone (linear.h).
[[nodiscard]] Labeling solve_linear(const Rig& rig, std::span<const GridGraph> graphs);

/// The paper's B: the linear solution of every component, corrected by other views (multiview.h).
[[nodiscard]] Labeling solve_multiview(const Rig& rig, std::span<const GridGraph> graphs,
                                       const MultiviewOptions& options = {});

/// One grid of one camera after the other, each by one projector's vertical and horizontal lines
/// (single_projector.h).
[[nodiscard]] Labeling solve_projector_grids(const Rig& rig, std::span<const GridGraph> graphs,
                                             const SingleProjectorOptions& options = {});

}  // namespace pencilscan
