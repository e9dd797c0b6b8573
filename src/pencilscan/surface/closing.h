#pragma once

#include <span>

#include "pencilscan/geometry/mesh.h"
#include "pencilscan/surface/sample.h"

namespace pencilscan {

struct ClosingOptions {
  double spacing_mm = 1;              ///< of the samples, > 0
  double cell_mm = 1;                 ///< wished size of an octree cell, > 0
  int max_depth = 8;                  ///< of the octree
  double reach_spacings = 1;          ///< a vertex farther from all samples was not measured
  double min_component_share = 0.05;  ///< of the largest component's measured area
};

struct ClosedSurface {
  TriangleMesh mesh;  ///< with sigma and confidence
  int depth = 0;      ///< of the octree
  double scale = 0;   ///< octree cube / bounding cube of the samples
  std::size_t components_removed = 0;
};

/// Screened Poisson surface of the samples in a cube within which it closes, or else capped where
/// it leaves the cube, without components that hardly anything measured.
[[nodiscard]] ClosedSurface closed_surface(std::span<const SurfaceSample> samples,
                                           const ClosingOptions& options);

}  // namespace pencilscan
