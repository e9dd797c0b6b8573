#pragma once

#include <span>
#include <vector>

#include "pencilscan/depth/depth_map.h"
#include "pencilscan/rig/rig.h"
#include "pencilscan/view/color_family.h"

namespace pencilscan {

struct ConsistencyOptions {
  double margin = 3;  ///< footprints by which a segment must pass through a surface, > 0
  double contradiction_weight = 3;  ///< of one contradiction against one support
  double min_confidence = 0.5;
  int rounds = 6;
  int min_component = 12;  ///< nodes; smaller unsupported islands are dropped
};

struct ConsistencyReport {
  double sigma_scale = 1;        ///< by which the cameras' disagreement exceeds what sigma says
  double sigma_factor = 1;       ///< by which sigma was widened: errors that all share, too
  std::size_t contradicted = 0;  ///< nodes removed
  std::size_t unconfirmed = 0;   ///< nodes of one projector removed, as no one confirms them
  std::size_t islands = 0;       ///< nodes removed as small islands
};

/// What the depth maps say of each other. A measured node proves two segments empty: from its
/// camera and from every projector whose light was found there. A node of another map on such a
/// segment, more than a margin before its end, contradicts and is contradicted; a node of another
/// map at the same place supports. Belief b = (1 + S) / (1 + S + weight C), S and C summed over
/// cameras (and projectors for C) with the believed nodes counting most, averaged over neighbouring
/// nodes of one surface since errors are shifts of whole patches. Nodes below min_confidence lose
/// their depth (reason kContradicted); what nobody confirms stays. `pattern_projector`: projector
/// per lit bit.
ConsistencyReport check_consistency(const Rig& rig, std::span<const int> pattern_projector,
                                    std::span<DepthMap> maps,
                                    const ConsistencyOptions& options = {});

/// World point of a measured node.
[[nodiscard]] Vec3 node_point(const Rig& rig, const DepthMap& map, std::size_t node);
/// Unit normal towards the camera, world.
[[nodiscard]] Vec3 node_normal(const Rig& rig, const DepthMap& map, std::size_t node);

}  // namespace pencilscan
