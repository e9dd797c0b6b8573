#pragma once

#include <optional>
#include <span>
#include <string>

#include "pencilscan/evaluation/alignment.h"
#include "pencilscan/geometry/ray_scene.h"
#include "pencilscan/labeling/measured_point.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// Why a mesh can hardly be the true surface of a result: half of the points lie farther off it
/// than a twentieth of their own extent. A part of the truth lies near it however small it is, and
/// so does a result whose scale is off by a few per cent. Nothing where the mesh may be the truth,
/// or where there are no points.
[[nodiscard]] std::optional<std::string> truth_warning(const RayScene& truth,
                                                       std::span<const Vec3> points);

/// That the points fit at another pose about as well, so that the figures may be those of a wrong
/// one.
[[nodiscard]] std::optional<std::string> alignment_warning(const AlignmentReport& alignment);

/// That the figures are not in mm: the rig's unit is unknown, and no similarity has brought the
/// result to the truth's size.
[[nodiscard]] std::optional<std::string> unit_warning(const Rig& rig, AlignmentKind align);

/// Why a rig can hardly be the one that a result was made with: a point lies on its camera's ray
/// through its pixel, and half of them lie more than a pixel beside it, in which a label counts as
/// right. Nothing where it may be, or where there are no points; their cameras are the rig's.
[[nodiscard]] std::optional<std::string> other_rig_warning(const Rig& rig,
                                                           std::span<const MeasuredPoint> points);

}  // namespace pencilscan
