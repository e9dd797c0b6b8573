#pragma once

#include <span>
#include <vector>

#include "pencilscan/grid/grid_graph.h"
#include "pencilscan/labeling/labeling.h"

namespace pencilscan {

/// Takes back the labels next to denied lines. A surface that is wrong by whole lines fits the
/// places of all of them, and only the code tells: the picture shows the next line in another
/// colour. For a label speak its own colour and that of the next line on the other side, which a
/// wrong name has by chance every second time; against it, a colour that a right one has once in a
/// hundred times (GuidedMatchingOptions::confidence). What is taken back is undecided, with the
/// reason kContradicted.
void drop_beside_denied(const GridGraph& graph, std::span<const DeniedRun> denied,
                        std::vector<LabeledRun>& runs, std::vector<UndecidedRun>& undecided);

}  // namespace pencilscan
