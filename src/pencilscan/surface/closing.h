#pragma once

#include <optional>
#include <span>

#include "pencilscan/geometry/mesh.h"
#include "pencilscan/rig/rig.h"
#include "pencilscan/surface/sample.h"

namespace pencilscan {

struct ClosingOptions {
  double spacing_mm = 1;              ///< of the samples, > 0
  double cell_mm = 1;                 ///< side of a cell, > 0
  int max_depth = 9;                  ///< cells along the cube: at most 2 to this power
  double reach_spacings = 1;          ///< a vertex farther from all samples was not measured
  double min_component_share = 0.05;  ///< of the largest component's measured area
  std::optional<Floor> floor;         ///< nothing is below it
};

struct ClosedSurface {
  TriangleMesh mesh;  ///< with sigma and confidence
  int depth = 0;      ///< log2 of the cells along the cube
};

/// The closed surface of at least one oriented sample within a cube around all of them, without
/// sigma and confidence. Cells are larger than cell_mm (> 0) where 2^max_depth of them do not cross
/// the cube. Nothing is below the floor.
[[nodiscard]] ClosedSurface surface_within_cube(std::span<const SurfaceSample> samples,
                                                double cell_mm, int max_depth,
                                                const std::optional<Floor>& floor = std::nullopt);

/// The closed surface of the samples, without components that hardly anything measured.
[[nodiscard]] ClosedSurface closed_surface(std::span<const SurfaceSample> samples,
                                           const ClosingOptions& options);

}  // namespace pencilscan
