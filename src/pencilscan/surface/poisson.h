#pragma once

#include <span>

#include "pencilscan/geometry/mesh.h"
#include "pencilscan/surface/sample.h"

namespace pencilscan {

/// Screened Poisson surface of oriented samples, outward faces. Open3D's PoissonRecon on one
/// thread: with more, the bytes vary from run to run. depth in [1, 12], scale > 1 (1.5 or more, or
/// the surface may leave the octree's cube where nothing was seen). Empty when it finds no surface.
/// The only translation unit that includes Open3D.
[[nodiscard]] TriangleMesh poisson_surface(std::span<const SurfaceSample> samples, int depth,
                                           double scale);

}  // namespace pencilscan
