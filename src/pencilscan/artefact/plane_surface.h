#pragma once

#include <span>

#include "pencilscan/artefact/coverage.h"

namespace pencilscan {

/// A piece of surface in a plane.
struct PlaneSurface {
  double area_mm2 = 0;
  double length_mm = 0;  ///< >= width: of the smallest rectangle that holds it
  double width_mm = 0;
};

/// The connected piece of surface on which most of those points lie that are within the rectangle
/// (of all points, where none is): however far it goes on beyond it. Points are taken in the
/// rectangle's plane and belong together where the cells of a grid that hold them touch. The cells
/// are a tenth of the points' median distance from their middle wide, or wider where the points are
/// few, so that lines and small holes do not part a surface and things at a distance stay off it.
/// Nothing goes on from a cell most of whose neighbours are empty: a table that crosses the plane
/// joins nothing to the plate on it.
[[nodiscard]] PlaneSurface connected_surface(std::span<const Vec3> points,
                                             const PlateRectangle& rectangle);

}  // namespace pencilscan
