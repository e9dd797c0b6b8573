#pragma once

#include <cstdint>

#include "pencilscan/geometry/types.h"

namespace pencilscan {

/// One measured curve pixel: a vertex of points.ply (docs/formats.md).
struct MeasuredPoint {
  float x = 0, y = 0, z = 0;     ///< world, mm
  float u = 0, v = 0;            ///< camera pixel
  std::uint8_t camera = 0;       ///< index in the rig
  std::uint8_t projector = 0;    ///< index in the rig
  std::uint8_t pattern = 0;      ///< index in the projector's patterns
  std::uint16_t line = 0;        ///< line index in the pattern
  float sigma = 0;               ///< mm, one standard deviation along the camera ray
  float confidence = 0;          ///< 0..1
  float plane = 0;               ///< triangulated line coordinate
  float nx = 0, ny = 0, nz = 0;  ///< outward unit normal of the surface; 0 where it is not known
  /// Colour of the surface as a screen shows it (sRGB); 0 where the normal is.
  std::uint8_t red = 0, green = 0, blue = 0;
};

/// World, mm.
[[nodiscard]] inline Vec3 position_of(const MeasuredPoint& p) {
  return {static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)};
}

/// Unit; 0 where it is not known.
[[nodiscard]] inline Vec3 normal_of(const MeasuredPoint& p) {
  return {static_cast<double>(p.nx), static_cast<double>(p.ny), static_cast<double>(p.nz)};
}

inline void set_position(const Vec3& x, MeasuredPoint& p) {
  p.x = static_cast<float>(x.x());
  p.y = static_cast<float>(x.y());
  p.z = static_cast<float>(x.z());
}

}  // namespace pencilscan
