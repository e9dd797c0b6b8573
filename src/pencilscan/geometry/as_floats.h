#pragma once

#include "pencilscan/geometry/types.h"

namespace pencilscan {

/// The nearest single-precision values.
[[nodiscard]] Eigen::Vector3f to_floats(const Vec3& x);

/// x as files with single precision give it back. GCC 12 with -O2 leaves the rounding out where it
/// makes one vector operation of two conversions there and back: so one of them is out of its
/// sight.
[[nodiscard]] inline Vec3 as_floats(const Vec3& x) { return to_floats(x).cast<double>(); }

}  // namespace pencilscan
