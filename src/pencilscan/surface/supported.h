#pragma once

#include <span>
#include <vector>

#include "pencilscan/depth/depth_map.h"
#include "pencilscan/geometry/mesh.h"
#include "pencilscan/labeling/measured_point.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// Vertices that count as measured although no labelled line speaks for them; per vertex, 1: so it
/// is. Depth grows from labelled lines. Where all of these were taken back, nothing speaks for it.
///   1. No point lies within `reach` of the vertex. Or a place that pictures deny (`denied`) lies
///      there, nearer than any point.
///   2. Where one camera alone has depth (`maps`), no point of this camera lies within twice the
///      reach. Windows grow no farther from a labelled line, but a surface that others close
///      reaches into gaps.
/// Only points and places count whose camera the vertex faces: those behind something thin say
/// nothing of its front. `reach`: two line spacings. On a face that light meets at 60 degrees,
/// lines lie two spacings apart. Where one was not found, the middle of the gap is so far from the
/// next.
[[nodiscard]] std::vector<char> unsupported_vertices(const Rig& rig, const TriangleMesh& mesh,
                                                     std::span<const DepthMap> maps,
                                                     std::span<const MeasuredPoint> points,
                                                     std::span<const MeasuredPoint> denied,
                                                     double reach);

}  // namespace pencilscan
