#pragma once

#include <array>
#include <cstddef>

#include "pencilscan/geometry/device.h"

namespace pencilscan {

/// Where a device has the light of one colour, against where its K, distortion and pose say:
///   pixel_of_color = center + scale (pixel - center) + shift,   center = the middle of the image.
/// To first order what lenses (lateral colour) and panels that do not quite cover each other do.
struct ColorDisplacement {
  Vec2 shift_px = Vec2::Zero();
  double scale = 1;  ///< > 0

  [[nodiscard]] bool none() const { return shift_px.isZero(0) && scale == 1; }
};

/// Of the colours in files, in order.
constexpr std::array<const char*, 3> kColorNames{"red", "green", "blue"};

/// Of one device: red, green, blue light of the projectors ("color_registration" of rig.json).
struct ColorRegistration {
  std::array<ColorDisplacement, 3> colors;

  [[nodiscard]] bool none() const;
  /// Pixel where the device has colour k of what its model has at `pixel`.
  [[nodiscard]] Vec2 of_color(std::size_t k, const Device& device, const Vec2& pixel) const;
  /// Inverse of of_color().
  [[nodiscard]] Vec2 from_color(std::size_t k, const Device& device, const Vec2& pixel) const;
};

/// The middle of a device's image, px.
[[nodiscard]] inline Vec2 image_center(const Device& device) {
  return {0.5 * (device.width - 1), 0.5 * (device.height - 1)};
}

}  // namespace pencilscan
