#pragma once

#include <array>
#include <span>
#include <vector>

#include "pencilscan/geometry/ray_scene.h"
#include "pencilscan/labeling/labeling.h"
#include "pencilscan/labeling/measured_point.h"

namespace pencilscan {

/// `surface` below: a mesh whose vertices of confidence 0 were not measured; only where all three
/// of a face were does it say anything.
///
/// Takes the labels of curve points away that the surface contradicts: on none of the rays
/// through the point and a pixel beside it does the light of the labelled line, to half a line,
/// meet the surface where the ray does. Points whose rays all miss the surface keep their labels.
/// One of three points speaks for all three. What loses its label is undecided, as contradicted.
/// Returns the number of such points.
std::size_t drop_contradicted(const Rig& rig, const RayScene& surface,
                              std::span<const GridGraph> graphs, Labeling& labeling);

struct SettledPoints {
  std::vector<MeasuredPoint> points;
  std::vector<char> on_surface;  ///< per point: 1 where it lies on the surface now
  std::size_t contradicted = 0;  ///< points left out
};

/// The points, moved along their camera rays onto the surface, which has a sigma at each vertex and
/// knows the light of all pixels and cameras around. Their sigma is that of the surface, and grows
/// with how far they were off; their normal is its, and their colour, where `colors` has the albedo
/// of each of its vertices (linear light, as TriangleMesh::color). Without those whose line the
/// surface contradicts, as above, and those that are too far off it for both to be right. Points
/// that are odd, or whose rays miss the surface, stay where they were.
[[nodiscard]] SettledPoints settle_on_surface(const Rig& rig, const RayScene& surface,
                                              std::span<const MeasuredPoint> points,
                                              std::span<const std::array<float, 3>> colors = {});

}  // namespace pencilscan
