#pragma once

#include "pencilscan/geometry/types.h"

namespace pencilscan {

/// Of rotation_error(): what a file states and lies above this is no rotation.
inline constexpr double kRotationTolerance = 1e-4;

/// Largest entry of |R R' - I|.
[[nodiscard]] inline double rotation_error(const Mat3& R) {
  return (R * R.transpose() - Mat3::Identity()).cwiseAbs().maxCoeff();
}

}  // namespace pencilscan
