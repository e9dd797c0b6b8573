#include "pencilscan/exchange/brown_fit.h"

#include <algorithm>

#include "pencilscan/geometry/least_squares.h"

namespace pencilscan {
namespace {

constexpr int kLattice = 24;  ///< places along each side of the image

/// The undistorted coordinates that the lens shows at `distorted`, by Newton's method.
Vec2 lens_inverse(const LensModel& lens, const Vec2& distorted) {
  constexpr int kRounds = 30;
  constexpr double kStep = 1e-6;
  Vec2 x = distorted;
  for (int i = 0; i < kRounds; ++i) {
    const Vec2 miss = lens(x) - distorted;
    Eigen::Matrix2d J;
    J.col(0) = (lens(x + Vec2(kStep, 0)) - lens(x - Vec2(kStep, 0))) / (2 * kStep);
    J.col(1) = (lens(x + Vec2(0, kStep)) - lens(x - Vec2(0, kStep))) / (2 * kStep);
    if (!(std::abs(J.determinant()) > 1e-9)) return x;
    x -= J.inverse() * miss;
  }
  return x;
}

/// d (x', y') / d (k1, k2, p1, p2, k3).
Eigen::Matrix<double, 2, 5> by_coefficients(const Vec2& x) {
  const double a = x.x();
  const double b = x.y();
  const double r2 = x.squaredNorm();
  Eigen::Matrix<double, 2, 5> rows;
  rows << a * r2, a * r2 * r2, 2 * a * b, r2 + 2 * a * a, a * r2 * r2 * r2,  //
      b * r2, b * r2 * r2, r2 + 2 * b * b, 2 * a * b, b * r2 * r2 * r2;
  return rows;
}

}  // namespace

BrownFit fit_brown(const Device& device, const LensModel& lens) {
  const Eigen::Vector2d focal(device.K(0, 0), device.K(1, 1));
  std::vector<Vec2> places;
  for (int j = 0; j <= kLattice; ++j) {
    for (int i = 0; i <= kLattice; ++i) {
      const double u = device.width * static_cast<double>(i) / kLattice - 0.5;
      const double v = device.height * static_cast<double>(j) / kLattice - 0.5;
      const double y = (v - device.K(1, 2)) / device.K(1, 1);
      places.push_back(lens_inverse(lens, {(u - device.K(0, 2)) / device.K(0, 0), y}));
    }
  }
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(5, 5);
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(5, 1);
  for (const Vec2& x : places) {
    const Eigen::Matrix<double, 2, 5> rows = focal.asDiagonal() * by_coefficients(x);
    normal += rows.transpose() * rows;
    right += rows.transpose() * focal.asDiagonal() * (lens(x) - x);
  }
  const Eigen::MatrixXd found = solve_symmetric(normal, right);
  BrownFit fit;
  std::copy_n(found.data(), 5, fit.distortion.k.begin());
  for (const Vec2& x : places)
    fit.worst_px = std::max(fit.worst_px,
                            (focal.asDiagonal() * (lens(x) - distort(fit.distortion, x))).norm());
  return fit;
}

LensModel thin_prism_lens(const std::array<double, 12>& coefficients) {
  Distortion rational;
  std::copy_n(coefficients.begin(), rational.k.size(), rational.k.begin());
  return [rational, s1 = coefficients[8], s2 = coefficients[9], s3 = coefficients[10],
          s4 = coefficients[11]](const Vec2& x) -> Vec2 {
    const double r2 = x.squaredNorm();
    return distort(rational, x) + r2 * Vec2(s1 + r2 * s2, s3 + r2 * s4);
  };
}

}  // namespace pencilscan
