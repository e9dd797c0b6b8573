#pragma once

#include <span>
#include <vector>

#include "pencilscan/labeling/measured_point.h"
#include "pencilscan/points/local_surface.h"

namespace pencilscan {

struct SettleOptions {
  double model_px = 0.05;  ///< what a quadratic patch misses: depth in pixel footprints, at tilt 0
  double max_deviations = 6;            ///< from the surface around, in standard deviations; > 0
  double min_alone_confidence = 0.995;  ///< of a point where nothing around shows one surface
  /// The rig is off, so that neighbours err alike and do not help each other: sigma stays at least
  /// the point's own.
  bool errors_are_shared = false;
};

/// Each point together with those around it: its depth becomes the mean, by variance, of its own
/// and that of the surface which all points around show (LocalSurface), so that a plane seen nearly
/// edge-on takes its depth from the others. Points that contradict the surface are left out, and
/// those of little confidence where there is none. Positions stay on their camera rays, sigma
/// covers what the patch could not follow. Keeps the order. `surfaces`: of each camera, as
/// second_look() or local_surfaces() give them.
[[nodiscard]] std::vector<MeasuredPoint> settle_points(const Rig& rig,
                                                       std::span<const MeasuredPoint> points,
                                                       std::span<const LocalSurface> surfaces,
                                                       const SettleOptions& options = {});

/// The surfaces that all points show, per camera.
[[nodiscard]] std::vector<LocalSurface> local_surfaces(const Rig& rig,
                                                       std::span<const MeasuredPoint> points,
                                                       const LocalSurfaceOptions& options = {});

}  // namespace pencilscan
