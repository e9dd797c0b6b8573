#include "extending/division_lens.h"

#include <cmath>

namespace pencilscan::example {

/// The division model: x = x' / (1 + lambda r'^2) (Fitzgibbon, "Simultaneous linear estimation of
/// multiple view geometry and lens distortion", CVPR 2001), solved for the distorted x'.
LensModel division_lens(double lambda) {
  return [lambda](const Vec2& straight) -> Vec2 {
    return straight * (2 / (1 + std::sqrt(1 - 4 * lambda * straight.squaredNorm())));
  };
}

}  // namespace pencilscan::example
