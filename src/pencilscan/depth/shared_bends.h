#pragma once

#include <cstddef>
#include <vector>

#include "pencilscan/depth/depth_map.h"
#include "pencilscan/geometry/types.h"

namespace pencilscan {

/// Windows that were fitted together: the nodes that they gave, and how well each fit alone knows
/// its quadric.
struct FittedWindows {
  int half = 0;  ///< radius, px
  std::vector<std::size_t> nodes;
  std::vector<Mat6> information;  ///< inverse covariance of a node's Quadric (window_fit.h)

  void add(std::size_t node, const Mat6& known) {
    nodes.push_back(node);
    information.push_back(known);
  }
};

/// How a surface slopes and bends is the least certain of what a window says, and most of the error
/// of its depth: fitted with the bend known, the middle has half the deviation (the quadric's six
/// unknowns over a disc, by Zernike polynomials). Windows around see the same surface. The slopes
/// and bends that they predict for a node are its prior (empirical Bayes): their mean, and their
/// mean square distance from the node's own, which holds the noise of both and how much the surface
/// changes. Neighbours that differ, as at a crease, a step or in relief, say little. Each node of
/// `fitted` gets the mean of its window and that prior, and its sigma.
///
/// Neighbours are up to two nodes away and uncut: a window of which a side is left out tells its
/// bend least. A node with fewer than seven of them keeps its own.
void share_bends(const FittedWindows& fitted, DepthMap& map);

}  // namespace pencilscan
