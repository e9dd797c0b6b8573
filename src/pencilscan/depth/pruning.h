#pragma once

#include <cmath>
#include <cstddef>

#include "pencilscan/depth/depth_map.h"

namespace pencilscan {

/// visit(node) for the measured nodes next to node i of a map, up to `reach` rows and columns away,
/// that continue its surface.
template <typename Visit>
void for_each_neighbor(const DepthMap& map, std::size_t i, int reach, Visit&& visit) {
  const int row = static_cast<int>(i) / map.columns;
  const int column = static_cast<int>(i) % map.columns;
  const DepthNode& n = map.nodes[i];
  for (int dr = -reach; dr <= reach; ++dr) {
    for (int dc = -reach; dc <= reach; ++dc) {
      const int r = row + dr;
      const int c = column + dc;
      if ((dr == 0 && dc == 0) || r < 0 || c < 0 || r >= map.rows || c >= map.columns) continue;
      const std::size_t j = map.index(r, c);
      const DepthNode& m = map.nodes[j];
      if (!m.measured()) continue;
      const float dx = static_cast<float>(dc * map.stride);
      const float dy = static_cast<float>(dr * map.stride);
      // Both tangent planes predict the middle.
      const float step =
          (m.w - 0.5F * (m.wx * dx + m.wy * dy)) - (n.w + 0.5F * (n.wx * dx + n.wy * dy));
      const float limit = (0.5F + 3 * (n.sigma + m.sigma)) * n.w * n.w;
      if (std::abs(step) < limit) visit(j);
    }
  }
}

// These remove nodes that no other view contradicts, but that nothing confirms either. Support and
// confidence of the nodes have to be known. Each returns the number of nodes that lost their depth.

/// The lines of one projector alone fit a surface that is off by a whole line as well as the true
/// one. A node with one projector's light that no other camera confirms therefore has to continue
/// into its neighbours, on nearly all sides unless a labelled curve passes through it.
std::size_t drop_lone_nodes(DepthMap& map);

/// The same once the closed surface has guided fits (depth.h): a start on it is as good as one on a
/// labelled curve, but no other camera was asked.
std::size_t drop_lone_guided_nodes(DepthMap& map);

/// Removes patches of one projector's lines that no other camera confirms: growth that slipped by a
/// line looks just like them. A patch stays if it rests on labelled curves and nothing contradicts
/// it.
std::size_t drop_unconfirmed_patches(DepthMap& map);

/// Removes islands of fewer than `min_nodes` nodes if other cameras confirm less than half of them,
/// and islands of any size that neither other cameras nor a labelled curve confirm: growth jumped
/// from a surface to get there.
std::size_t drop_islands(int min_nodes, DepthMap& map);

}  // namespace pencilscan
