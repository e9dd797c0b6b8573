#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pencilscan/geometry/types.h"
#include "pencilscan/labeling/measured_point.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// A short piece of one measured curve.
struct SurfaceSample {
  Vec3 position = Vec3::Zero();       ///< world, mm
  Vec3 to_camera = Vec3::UnitZ();     ///< unit, world
  Vec3 sheet_normal = Vec3::UnitX();  ///< unit normal of the light sheet, world
  Vec3 normal = Vec3::UnitZ();        ///< unit, outward once estimated
  double spacing = 0;     ///< mm between this light sheet and the next, across the sheets
  double sigma = 0;       ///< mm along the camera ray, of the mean
  double residual = 0;    ///< mm, root mean square of the neighbours about the local surface
  double confidence = 0;  ///< mean of the points'
  /// The same for one camera, projector, pattern and line; of a depth node its place in the map.
  std::uint32_t curve = 0;
  std::uint8_t camera = 0;
  std::uint8_t projector = 0;
  std::uint32_t count = 0;  ///< points in it
};

struct SampleSet {
  std::vector<SurfaceSample> samples;
  std::vector<std::int32_t> sample_of_point;  ///< -1: coordinates not finite or beyond 10 km
  double spacing = 0;                         ///< median over the samples, mm
};

/// Groups the points of each curve by cubes of edge sample_spacings * median spacing.
/// InputError when a point names a device that the rig does not have.
[[nodiscard]] SampleSet sample_curves(const Rig& rig, std::span<const MeasuredPoint> points,
                                      double sample_spacings);

}  // namespace pencilscan
