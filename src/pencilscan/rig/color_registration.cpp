#include "pencilscan/rig/color_registration.h"

#include <algorithm>

namespace pencilscan {

bool ColorRegistration::none() const {
  return std::all_of(colors.begin(), colors.end(),
                     [](const ColorDisplacement& color) { return color.none(); });
}

Vec2 ColorRegistration::of_color(std::size_t k, const Device& device, const Vec2& pixel) const {
  const Vec2 center = image_center(device);
  return center + colors[k].scale * (pixel - center) + colors[k].shift_px;
}

Vec2 ColorRegistration::from_color(std::size_t k, const Device& device, const Vec2& pixel) const {
  const Vec2 center = image_center(device);
  return center + (pixel - center - colors[k].shift_px) / colors[k].scale;
}

}  // namespace pencilscan
