#pragma once

#include <span>
#include <vector>

#include "pencilscan/labeling/measured_point.h"
#include "pencilscan/points/local_surface.h"

namespace pencilscan {

struct SettleOptions {
  double model_px = 0.05;  ///< what a quadratic patch misses: depth in pixel footprints, at tilt 0
  double max_deviations = 6;  ///< from the surface around, in standard deviations; > 0
  /// Of a point where nothing around shows one surface, by margins in the picture.
  double min_alone_confidence = 0.99514;
  /// The rig is off. Neighbours then have the same error and cannot correct each other: sigma is
  /// never less than the point's own.
  bool errors_are_shared = false;
};

/// Fusion of each point with the surface around it. The points around show a surface
/// (LocalSurface), and the new depth is the mean of the point's and of the surface's, weighted by
/// their variances: a light sheet seen nearly edge-on thereby takes its depth from the other
/// points. A point that contradicts the surface is left out; so is a point of little confidence
/// where no surface is. Positions stay on their camera rays. sigma includes what the patch could
/// not follow. The order is kept. `surfaces`: of each camera, from match_guided() or
/// local_surfaces().
[[nodiscard]] std::vector<MeasuredPoint> settle_points(const Rig& rig,
                                                       std::vector<MeasuredPoint> points,
                                                       std::span<const LocalSurface> surfaces,
                                                       const SettleOptions& options = {});

/// The points of each camera, in their order.
[[nodiscard]] std::vector<std::vector<MeasuredPoint>> points_by_camera(
    const Rig& rig, std::span<const MeasuredPoint> points);

/// The surfaces that all points show, per camera.
[[nodiscard]] std::vector<LocalSurface> local_surfaces(const Rig& rig,
                                                       std::span<const MeasuredPoint> points,
                                                       const LocalSurfaceOptions& options = {});

}  // namespace pencilscan
