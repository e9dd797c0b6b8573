#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace pencilscan {

/// Linear light in [0, 1] -> the values that screens and mesh viewers expect (IEC 61966-2-1).
[[nodiscard]] inline double to_srgb(double linear) {
  const double x = std::clamp(linear, 0.0, 1.0);
  return x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055;
}

/// The same in 255 steps.
[[nodiscard]] inline std::uint8_t to_srgb_byte(double linear) {
  return static_cast<std::uint8_t>(std::lround(255 * to_srgb(linear)));
}

/// The way back.
[[nodiscard]] inline double from_srgb(double shown) {
  const double x = std::clamp(shown, 0.0, 1.0);
  return x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4);
}

}  // namespace pencilscan
