#pragma once

#include <span>
#include <vector>

#include "pencilscan/geometry/mesh.h"
#include "pencilscan/labeling/measured_point.h"

namespace pencilscan {

/// Per vertex, 1 where it counts as measured and no point lies within `reach` of it, or one of the
/// places that pictures deny lies there and is nearer than any point. Depth grows
/// from labelled lines; where all of them were taken back, nothing speaks for it. Lines of a face
/// that light meets at 60 degrees lie two line spacings apart, and where one of them was not found
/// the middle of the gap is two spacings from the next: so far right surface may lie from its
/// points.
[[nodiscard]] std::vector<char> unsupported_vertices(const TriangleMesh& mesh,
                                                     std::span<const MeasuredPoint> points,
                                                     std::span<const MeasuredPoint> denied,
                                                     double reach);

}  // namespace pencilscan
