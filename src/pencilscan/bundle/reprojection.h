#pragma once

#include <ceres/rotation.h>

#include "pencilscan/bundle/bundle.h"

namespace pencilscan {

/// Pixel of a point in world; T is double or a Ceres jet. Brown-Conrady distortion as in
/// geometry/device.h. A point at or behind the pinhole gives no sensible pixel: `ok` is false.
template <typename T>
bool project_point(const T* pose, const T* inner, const T* point, T* pixel) {
  T x[3];
  ceres::AngleAxisRotatePoint(pose, point, x);
  for (int i = 0; i < 3; ++i) x[i] += pose[3 + i];
  if (!(x[2] > T(1e-6))) return false;
  const T a = x[0] / x[2];
  const T b = x[1] / x[2];
  const T r2 = a * a + b * b;
  const T radial = T(1) + r2 * (inner[kK1] + r2 * (inner[kK2] + r2 * inner[kK3]));
  const T u = a * radial + T(2) * inner[kP1] * a * b + inner[kP2] * (r2 + T(2) * a * a);
  const T v = b * radial + inner[kP1] * (r2 + T(2) * b * b) + T(2) * inner[kP2] * a * b;
  pixel[0] = inner[kFx] * u + inner[kCx];
  pixel[1] = inner[kFy] * v + inner[kCy];
  return true;
}

/// (pi(X) - u) / sigma.
struct ReprojectionCost {
  Vec2 pixel;
  double sigma;

  template <typename T>
  bool operator()(const T* pose, const T* inner, const T* point, T* residual) const {
    T projected[2];
    if (!project_point(pose, inner, point, projected)) return false;
    residual[0] = (projected[0] - T(pixel.x())) / T(sigma);
    residual[1] = (projected[1] - T(pixel.y())) / T(sigma);
    return true;
  }
};

/// The same for a point of a board.
struct BoardCost {
  ReprojectionCost reprojection;
  Vec2 position;

  template <typename T>
  bool operator()(const T* pose, const T* inner, const T* board, T* residual) const {
    const T on_board[3] = {T(position.x()), T(position.y()), T(0)};
    T point[3];
    ceres::AngleAxisRotatePoint(board, on_board, point);
    for (int i = 0; i < 3; ++i) point[i] += board[3 + i];
    return reprojection(pose, inner, point, residual);
  }
};

}  // namespace pencilscan
