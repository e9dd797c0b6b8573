#pragma once

#include <ceres/rotation.h>

#include "pencilscan/bundle/bundle.h"

namespace pencilscan {

/// Pixel of a point in world; T is double or a Ceres jet. False at or behind the pinhole, where
/// there is no sensible pixel.
template <typename T>
bool project_point(const T* pose, const T* inner, const HeldInner& held, const T* point, T* pixel) {
  T x[3];
  ceres::AngleAxisRotatePoint(pose, point, x);
  for (int i = 0; i < 3; ++i) x[i] += pose[3 + i];
  if (!(x[2] > T(1e-6))) return false;
  const auto k = lens_coefficients(inner, held.denominator);
  T shown[2];
  distort_coordinates(k.data(), T(x[0] / x[2]), T(x[1] / x[2]), shown);
  pixel[0] = inner[kFx] * shown[0] + T(held.skew) * shown[1] + inner[kCx];
  pixel[1] = inner[kFy] * shown[1] + inner[kCy];
  return true;
}

/// (pi(X) - u) / sigma.
struct ReprojectionCost {
  Vec2 pixel;
  double sigma;
  HeldInner held;  ///< of the device

  template <typename T>
  bool operator()(const T* pose, const T* inner, const T* point, T* residual) const {
    T projected[2];
    if (!project_point(pose, inner, held, point, projected)) return false;
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
