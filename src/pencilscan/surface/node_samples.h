#pragma once

#include <span>
#include <vector>

#include "pencilscan/depth/depth_map.h"
#include "pencilscan/rig/rig.h"
#include "pencilscan/surface/sample.h"

namespace pencilscan {

/// One sample per measured node of the depth maps, in their order; `spacing`: median distance of
/// neighbouring nodes on the surface, in the rig's unit.
[[nodiscard]] std::vector<SurfaceSample> node_samples(const Rig& rig,
                                                      std::span<const DepthMap> maps,
                                                      double& spacing);

/// Adds those of the measured nodes that have none among `samples`.
void add_node_samples(const Rig& rig, std::span<const DepthMap> maps,
                      std::vector<SurfaceSample>& samples);

}  // namespace pencilscan
