#pragma once

#include <span>
#include <vector>

#include "pencilscan/geometry/mesh.h"
#include "pencilscan/surface/sample.h"

namespace pencilscan {

/// How a surface got to where a later moment measured it.
struct Registration {
  std::vector<Vec3> vertices;  ///< of the mesh, moved
  RigidTransform motion;       ///< of the whole, before its parts moved on their own
};

/// Moves a mesh onto oriented points of the same object a moment later. First the whole moves
/// rigidly, started with `predicted` (iterated closest points with distances to planes: Y. Chen and
/// G. Medioni, Object modelling by registration of multiple range images, IVC 1992), then
/// overlapping parts do, smaller ones in each round (as in H. Li, R. Sumner, M. Pauly, Global
/// correspondence optimization for non-rigid registration of depth scans, SGP 2008, with windows
/// instead of a graph). Only motion along normals can be seen; what slides stays where its part
/// goes. Places without points follow what is around them. `spacing`: of the points; same unit.
[[nodiscard]] Registration register_surface(const TriangleMesh& mesh,
                                            std::span<const SurfaceSample> later, double spacing,
                                            const RigidTransform& predicted = {});

}  // namespace pencilscan
