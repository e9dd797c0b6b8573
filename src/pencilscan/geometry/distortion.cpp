#include "pencilscan/geometry/distortion.h"

namespace pencilscan {

Vec2 distort(const Distortion& distortion, const Vec2& normalized) {
  Vec2 shown;
  distort_coordinates(distortion.k.data(), normalized.x(), normalized.y(), shown.data());
  return shown;
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
