#pragma once

#include <span>
#include <vector>

#include "pencilscan/depth/depth_map.h"
#include "pencilscan/geometry/mesh.h"
#include "pencilscan/labeling/measured_point.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// Per vertex, 1 where it counts as measured and no point lies within `reach` of it, or one of the
/// places that pictures deny lies there and is nearer than any point. Only points and places whose
/// camera the vertex faces count: those on the other side of something thin say nothing of this
/// side. Depth grows from labelled lines; where all of them were taken back, nothing speaks for it.
/// Lines of a face that light meets at 60 degrees lie two line spacings apart, and where one of
/// them was not found the middle of the gap is two spacings from the next: so far right surface may
/// lie from its points. Where one camera alone has depth (`maps`), a point of this camera has to
/// lie within twice the reach: windows grow no farther from a labelled line, and surfaces that
/// others close reach into gaps.
[[nodiscard]] std::vector<char> unsupported_vertices(const Rig& rig, const TriangleMesh& mesh,
                                                     std::span<const DepthMap> maps,
                                                     std::span<const MeasuredPoint> points,
                                                     std::span<const MeasuredPoint> denied,
                                                     double reach);

}  // namespace pencilscan
