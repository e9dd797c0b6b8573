#pragma once

#include <optional>
#include <span>
#include <vector>

#include "pencilscan/depth/depth_map.h"
#include "pencilscan/rig/rig.h"
#include "pencilscan/view/color_family.h"

namespace pencilscan {

struct ConsistencyOptions {
  double margin = 3;           ///< footprints by which a segment must pass through a surface, > 0
  double margin_lines = 0.25;  ///< line spacings, if that is more
  double contradiction_weight = 3;  ///< of one contradiction against one support
  double min_confidence = 0.5;
  int rounds = 6;
  int min_component = 12;  ///< nodes; smaller unsupported islands are dropped
};

struct ConsistencyReport {
  double sigma_scale = 1;  ///< by which the cameras' disagreement exceeds what sigma says
  /// What neighbouring places have in common of it; nothing where too few places tell.
  std::optional<double> shared_scale;
  double sigma_factor = 1;       ///< by which sigma was widened: errors that all share, too
  std::size_t contradicted = 0;  ///< nodes removed
  std::size_t unconfirmed = 0;   ///< nodes of one projector removed, as no one confirms them
  std::size_t islands = 0;       ///< nodes removed as small islands
};

/// Checks the depth maps against each other. A measured node proves that two segments are empty:
/// the one to its camera, and the one to every projector whose light was found there. A node of
/// another map that lies on such a segment, more than a margin before its end, contradicts this
/// node and is contradicted by it. A node of another map at the same place supports this node. The
/// belief in a node is b = (1 + S) / (1 + S + weight C). S and C are sums over cameras (C also over
/// projectors) of the most believed node of each. They are averaged over neighbouring nodes of one
/// surface, because whole patches are wrong together. A node below min_confidence loses its depth
/// (reason kContradicted). A node that nobody confirms stays. `pattern_projector`: projector per
/// lit bit.
ConsistencyReport check_consistency(const Rig& rig, std::span<const int> pattern_projector,
                                    std::span<DepthMap> maps,
                                    const ConsistencyOptions& options = {});

/// World point of a measured node.
[[nodiscard]] Vec3 node_point(const Rig& rig, const DepthMap& map, std::size_t node);
/// Unit normal towards the camera, world.
[[nodiscard]] Vec3 node_normal(const Rig& rig, const DepthMap& map, std::size_t node);

}  // namespace pencilscan
