#pragma once

#include <algorithm>
#include <array>

namespace pencilscan {

/// Number of the pixel that holds a coordinate: counted from 1024 pixels before the image, because
/// curves may leave it a little; never negative. Double precision: in single precision the sum
/// itself rounds, and 289.49998 would fall into pixel 290.
[[nodiscard]] inline unsigned pixel_number(float coordinate) {
  constexpr double kMargin = 1024;
  return static_cast<unsigned>(std::max(0.0, static_cast<double>(coordinate) + kMargin + 0.5));
}

/// Whether a pixel belongs to a lattice of `used_of_seven` pixels of seven that every line of
/// pixels, upright, flat or diagonal, meets as often.
[[nodiscard]] inline bool is_on_lattice(float u, float v, int used_of_seven) {
  constexpr std::array<int, 7> kOrder = {0, 4, 2, 1, 5, 3, 6};
  return kOrder[(pixel_number(u) + 2 * pixel_number(v)) % 7] < used_of_seven;
}

}  // namespace pencilscan
