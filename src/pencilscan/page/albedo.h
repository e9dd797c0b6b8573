#pragma once

#include <span>
#include <vector>

#include "pencilscan/geometry/ray_scene.h"
#include "pencilscan/io/curve_file.h"
#include "pencilscan/io/point_file.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// How bright the surface is, up to one common factor, from how bright the lines on it are: a
/// Lambertian surface at distance d from the projector, under incidence angle a, returns
/// albedo cos(a) / d^2 of the light. Rough: blur and lines close together dim a line as well.
struct AlbedoEstimate {
  std::vector<float> points;    ///< per point; NaN: no curve there
  std::vector<float> vertices;  ///< per vertex of the surface, from the points around; NaN: none
};

/// Scaled so that 95 % lie below 0.9.
[[nodiscard]] AlbedoEstimate estimate_albedo(const Rig& rig, std::span<const MeasuredPoint> points,
                                             const CurveFile& curves, const RayScene& surface);

/// 0..1 as an 8-bit sRGB-like value (gamma 2.2), 0: none.
[[nodiscard]] std::vector<std::uint8_t> albedo_bytes(std::span<const float> albedo);

}  // namespace pencilscan
