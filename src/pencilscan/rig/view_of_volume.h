#pragma once

#include <algorithm>

#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// World direction of the ray through the picture's middle. A projector whose lens is shifted, as
/// most are, shines beside its optical axis.
[[nodiscard]] inline Vec3 gaze(const Device& device) {
  return device.ray({0.5 * (device.width - 1), 0.5 * (device.height - 1)}).direction;
}

/// From a device to the volume's centre. One within the volume sees things a radius away and
/// nearer.
[[nodiscard]] inline double viewing_distance(const Device& device, const Sphere& volume) {
  return std::max((device.center() - volume.center).norm(), volume.radius);
}

}  // namespace pencilscan
