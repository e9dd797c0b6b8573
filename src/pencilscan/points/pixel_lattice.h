#pragma once

#include <algorithm>
#include <array>

namespace pencilscan {

/// Whether a pixel belongs to a lattice of `used_of_seven` pixels of seven that every line of
/// pixels, upright, flat or diagonal, meets as often.
[[nodiscard]] inline bool is_on_lattice(float u, float v, int used_of_seven) {
  constexpr std::array<int, 7> kOrder = {0, 4, 2, 1, 5, 3, 6};
  constexpr float kMargin = 1024;  // curves may leave the image a little
  const auto column = static_cast<unsigned>(std::max(0.F, u + kMargin + 0.5F));
  const auto row = static_cast<unsigned>(std::max(0.F, v + kMargin + 0.5F));
  return kOrder[(column + 2 * row) % 7] < used_of_seven;
}

}  // namespace pencilscan
