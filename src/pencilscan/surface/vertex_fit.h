#pragma once

#include <span>

#include "pencilscan/geometry/mesh.h"
#include "pencilscan/surface/sample.h"

namespace pencilscan {

/// Every face cut into four at the middles of its edges; properties are averaged.
[[nodiscard]] TriangleMesh subdivided(const TriangleMesh& mesh);

/// Moves each measured vertex along its normal onto the quadric of the samples within `radius`
/// (moving least squares, weights as in local_fit.h), which carries finer detail than the octree's
/// cells. No farther than a quarter of the radius, and not at all where samples do not surround it.
void fit_vertices(std::span<const SurfaceSample> samples, double radius, TriangleMesh& mesh);

}  // namespace pencilscan
