#pragma once

#include <cstddef>

#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// A rig's devices as one list: the cameras, then the projectors.
[[nodiscard]] inline std::size_t device_count(const Rig& rig) {
  return rig.cameras.size() + rig.projectors.size();
}
[[nodiscard]] inline const Device& device_at(const Rig& rig, std::size_t index) {
  if (index < rig.cameras.size()) return rig.cameras[index];
  return rig.projectors[index - rig.cameras.size()];
}
[[nodiscard]] inline Device& device_at(Rig& rig, std::size_t index) {
  if (index < rig.cameras.size()) return rig.cameras[index];
  return rig.projectors[index - rig.cameras.size()];
}

}  // namespace pencilscan
