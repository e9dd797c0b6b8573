#pragma once

#include "pencilscan/geometry/types.h"

namespace pencilscan {

/// The matrix whose product with x is the cross product v x x.
[[nodiscard]] inline Mat3 cross_matrix(const Vec3& v) {
  Mat3 m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

}  // namespace pencilscan
