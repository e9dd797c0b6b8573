#include "pencilscan/geometry/distortion.h"

namespace pencilscan {

Vec2 distort(const Distortion& distortion, const Vec2& normalized) {
  const auto [k1, k2, p1, p2, k3, k4, k5, k6] = distortion.k;
  const double x = normalized.x();
  const double y = normalized.y();
  const double r2 = x * x + y * y;
  const double radial =
      (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)));
  return {x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
          y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
}

Eigen::Matrix2d distortion_slope(const Distortion& distortion, const Vec2& normalized) {
  const auto [k1, k2, p1, p2, k3, k4, k5, k6] = distortion.k;
  const double x = normalized.x();
  const double y = normalized.y();
  const double r2 = x * x + y * y;
  const double above = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  const double below = 1 + r2 * (k4 + r2 * (k5 + r2 * k6));
  const double above_slope = k1 + r2 * (2 * k2 + 3 * k3 * r2);  // d above / d r^2
  const double below_slope = k4 + r2 * (2 * k5 + 3 * k6 * r2);
  const double radial = above / below;
  const double radial_slope = (above_slope - radial * below_slope) / below;
  Eigen::Matrix2d slope;
  slope(0, 0) = radial + 2 * x * x * radial_slope + 2 * p1 * y + 6 * p2 * x;
  slope(0, 1) = slope(1, 0) = 2 * x * y * radial_slope + 2 * p1 * x + 2 * p2 * y;
  slope(1, 1) = radial + 2 * y * y * radial_slope + 6 * p1 * y + 2 * p2 * x;
  return slope;
}

Eigen::Matrix<double, 2, Distortion::kBrown> distortion_by_brown(const Distortion& distortion,
                                                                 const Vec2& normalized) {
  using D = Distortion;
  const double x = normalized.x();
  const double y = normalized.y();
  const double r2 = x * x + y * y;
  const double below =
      1 + r2 * (distortion[D::kK4] + r2 * (distortion[D::kK5] + r2 * distortion[D::kK6]));
  const Vec2 radial = normalized * (r2 / below);
  Eigen::Matrix<double, 2, D::kBrown> by;
  by.col(D::kK1) = radial;
  by.col(D::kK2) = radial * r2;
  by.col(D::kK3) = radial * (r2 * r2);
  by.col(D::kP1) = Vec2(2 * x * y, r2 + 2 * y * y);
  by.col(D::kP2) = Vec2(r2 + 2 * x * x, 2 * x * y);
  return by;
}

Vec2 undistort(const Distortion& distortion, const Vec2& distorted) {
  Vec2 n = distorted;
  constexpr int kMaxIterations = 20;
  for (int i = 0; i < kMaxIterations; ++i) {
    const Vec2 step =
        distortion_slope(distortion, n).inverse() * (distorted - distort(distortion, n));
    n += step;
    if (step.squaredNorm() < 1e-26) break;
  }
  return n;
}

}  // namespace pencilscan
