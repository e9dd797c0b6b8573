#pragma once

#include <algorithm>

#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// From a device to the volume's centre. One within the volume sees things a radius away and
/// nearer.
[[nodiscard]] inline double viewing_distance(const Device& device, const Sphere& volume) {
  return std::max((device.center() - volume.center).norm(), volume.radius);
}

}  // namespace pencilscan
