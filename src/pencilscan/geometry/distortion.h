#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "pencilscan/geometry/types.h"

namespace pencilscan {

/// Lens distortion by OpenCV's rational model ("Camera Calibration and 3D Reconstruction"), on
/// normalised coordinates (x, y), r^2 = x^2 + y^2:
/// x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)
///      + 2 p1 x y + p2 (r^2 + 2 x^2), y' likewise.
/// With k4 = k5 = k6 = 0 it is the Brown-Conrady model. Nothing else in the program knows a formula
/// of lenses, but the page (web/src/device.ts).
struct Distortion {
  enum Coefficient : std::size_t { kK1, kK2, kP1, kP2, kK3, kK4, kK5, kK6, kCoefficients };
  static constexpr std::size_t kBrown = kK4;  ///< so many come before the denominator's

  std::array<double, kCoefficients> k{};

  double& operator[](std::size_t i) { return k[i]; }
  double operator[](std::size_t i) const { return k[i]; }
  bool operator==(const Distortion&) const = default;
  [[nodiscard]] bool is_none() const { return k == decltype(k){}; }
  [[nodiscard]] bool is_rational() const { return k[kK4] != 0 || k[kK5] != 0 || k[kK6] != 0; }
  /// The coefficients as files state them: 8, or 5 where the denominator is 1.
  [[nodiscard]] std::vector<double> stated() const {
    return {k.data(), k.data() + (is_rational() ? kCoefficients : kBrown)};
  }
};

/// Undistorted to distorted normalised coordinates.
[[nodiscard]] Vec2 distort(const Distortion& distortion, const Vec2& normalized);

/// Derivative of distort(): d distorted / d normalized.
[[nodiscard]] Eigen::Matrix2d distortion_slope(const Distortion& distortion,
                                               const Vec2& normalized);

/// Derivative of distort() by the coefficients before the denominator's.
[[nodiscard]] Eigen::Matrix<double, 2, Distortion::kBrown> distortion_by_brown(
    const Distortion& distortion, const Vec2& normalized);

/// Inverse of distort() by Newton's method, to 1e-12 in normalised units where it converges.
[[nodiscard]] Vec2 undistort(const Distortion& distortion, const Vec2& distorted);

}  // namespace pencilscan
