#pragma once

#include <cstdint>

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

}  // namespace pencilscan
