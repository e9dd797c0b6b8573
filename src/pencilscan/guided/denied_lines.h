#pragma once

#include <span>
#include <vector>

#include "pencilscan/grid/grid_graph.h"
#include "pencilscan/labeling/labeling.h"

namespace pencilscan {

/// Takes back labels beside denied lines: those of the two lines on either side of each. A line is
/// denied where the picture shows it in another colour than its label has. Such a colour is the
/// only sign of a surface that is wrong by whole lines, because that fits the places of all lines.
/// Beside a right label it happens once in a hundred times (GuidedMatchingOptions::confidence). So
/// it outweighs six lines whose colours agree: on a wrong surface each agrees every second time. A
/// label two lines away has four such neighbours at most. What is taken back is undecided, with the
/// reason kContradicted.
void drop_beside_denied(const GridGraph& graph, std::span<const DeniedRun> denied,
                        std::vector<LabeledRun>& runs, std::vector<UndecidedRun>& undecided);

}  // namespace pencilscan
