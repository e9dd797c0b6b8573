#pragma once

#include <array>
#include <functional>

#include "pencilscan/geometry/device.h"

namespace pencilscan {

/// Another lens model: undistorted to distorted normalised coordinates.
using LensModel = std::function<Vec2(const Vec2&)>;

struct BrownFit {
  Distortion distortion;  ///< no denominator
  double worst_px = 0;    ///< largest difference over the image
};

/// The Brown-Conrady distortion that is nearest to another lens model over the image of a device
/// whose size and K count: linear least squares, since x' is linear in the five coefficients.
[[nodiscard]] BrownFit fit_brown(const Device& device, const LensModel& lens);

/// OpenCV's rational model with a thin prism, coefficients k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 in
/// this order (OpenCV, "Camera Calibration and 3D Reconstruction").
[[nodiscard]] LensModel thin_prism_lens(const std::array<double, 12>& coefficients);

}  // namespace pencilscan
