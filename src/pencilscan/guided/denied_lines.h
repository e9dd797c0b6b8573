#pragma once

#include <span>
#include <vector>

#include "pencilscan/grid/grid_graph.h"
#include "pencilscan/labeling/labeling.h"

namespace pencilscan {

/// Takes back the labels of the two lines on either side of denied ones, beside them. A surface
/// that is wrong by whole lines fits the places of all of them, and only the code tells: the
/// picture shows a line near by in another colour. That happens once in a hundred times beside a
/// right label (GuidedMatchingOptions::confidence), and outweighs the colours of six lines that
/// agree, which a wrong surface has by chance every second time: a label two lines away has four
/// such neighbours at most. What is taken back is undecided, with the reason kContradicted.
void drop_beside_denied(const GridGraph& graph, std::span<const DeniedRun> denied,
                        std::vector<LabeledRun>& runs, std::vector<UndecidedRun>& undecided);

}  // namespace pencilscan
