#pragma once

#include "pencilscan/geometry/types.h"

namespace pencilscan {

enum class TextureKind { kNone, kNoise, kStripes, kChecker };

/// Solid procedural texture: a function of the position in the object, so it moves along with it.
struct SurfaceTexture {
  TextureKind kind = TextureKind::kNone;
  double contrast = 0.5;  ///< darkest = 1 - contrast times the brightest, in [0, 1]
  double period_mm = 20;  ///< > 0

  /// Factor on the albedo at a point of the object (mm), in [1 - contrast, 1].
  [[nodiscard]] double factor(const Vec3& x_in_object) const;
};

}  // namespace pencilscan
