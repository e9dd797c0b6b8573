#pragma once

#include <string>
#include <vector>

#include "pencilscan/pattern/line_pattern.h"

namespace pencilscan {

/// An even image for a projector to show, from which crosstalk and gamma are found.
struct SolidImage {
  std::string name;  ///< of the file, without ending
  Rgb value{};       ///< as stored in the projected image, [0, 1]
};

/// red, green, blue; grey25, grey50, grey75: white at a quarter, half and three quarters of the
/// full value (the response of the projector). Full white and black are part of the Gray codes.
[[nodiscard]] std::vector<SolidImage> solid_images();

}  // namespace pencilscan
