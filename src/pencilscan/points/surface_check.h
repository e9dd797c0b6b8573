#pragma once

#include <array>
#include <span>
#include <vector>

#include "pencilscan/geometry/ray_scene.h"
#include "pencilscan/labeling/labeling.h"
#include "pencilscan/labeling/measured_point.h"
#include "pencilscan/uncertainty/error_model.h"

namespace pencilscan {

// `surface` below is a mesh. Its vertices of confidence 0 were not measured. A face tells something
// only if all three of its vertices were measured.

/// Removes the labels of curve points that the surface contradicts. The test takes the rays through
/// the point and through the pixels beside it. The surface contradicts the label if, on every ray,
/// the labelled line's light is more than half a line away from where the ray meets the surface. A
/// point whose rays all miss the surface keeps its label. One point of three is tested, for all
/// three. A point that loses its label is undecided, with the reason kContradicted.
/// Returns the number of such points.
std::size_t drop_contradicted(const Rig& rig, const RayScene& surface,
                              std::span<const GridGraph> graphs, Labeling& labeling);

struct SettledPoints {
  std::vector<MeasuredPoint> points;
  std::vector<PointEvidence> evidence;  ///< per point: what its sigma rests on
  std::size_t contradicted = 0;         ///< points left out
};

/// Moves the points along their camera rays onto the surface. The surface is more certain than a
/// point, because it rests on all pixels and cameras around. Sigma is that of point_sigma(): the
/// surface's and a share of the way that the point moved. A moved point takes its normal from
/// the surface, too, and its colour where `colors` has the albedo of each vertex (linear light, as
/// TriangleMesh::color). Two kinds of points are left out: those that the surface contradicts (as
/// above), and those so far off it that one of the two must be wrong. Points that are odd, or whose
/// rays miss the surface, stay where they were, with two exceptions. Those of less confidence than
/// `min_alone_confidence` go: nothing but their own label speaks for them (as in settle_points()).
/// So do those where another camera sees measured surface within their deviation that is known
/// three times as well: at grazing rays they would only be the worst points of a surface that
/// better ones cover.
[[nodiscard]] SettledPoints settle_on_surface(const Rig& rig, const RayScene& surface,
                                              std::span<const MeasuredPoint> points,
                                              float min_alone_confidence,
                                              std::span<const std::array<float, 3>> colors = {});

}  // namespace pencilscan
