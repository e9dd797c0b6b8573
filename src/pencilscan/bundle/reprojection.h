#pragma once

#include <ceres/sized_cost_function.h>

#include <optional>

#include "pencilscan/bundle/bundle_device.h"

namespace pencilscan {

/// A point that a pose (angle-axis, then translation) moves, and how it changes with the pose and
/// with the point that is moved.
struct MovedPoint {
  Vec3 point;
  Eigen::Matrix<double, 3, 6> by_pose;
  Mat3 by_point;
};
[[nodiscard]] MovedPoint moved_point(const double* pose, const Vec3& point);

/// Where a device shows a point, px. Nothing at or behind the pinhole, where there is no sensible
/// pixel.
[[nodiscard]] std::optional<Vec2> shown_pixel(const double* pose, const double* inner,
                                              const HeldInner& held, const Vec3& point);

/// The same, and how it changes with the pose, with the inner parameters and with the point.
struct ShownPoint {
  Vec2 pixel;
  Eigen::Matrix<double, 2, 6, Eigen::RowMajor> by_pose;
  Eigen::Matrix<double, 2, kIntrinsics, Eigen::RowMajor> by_inner;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_point;
};

[[nodiscard]] std::optional<ShownPoint> shown_point(const double* pose, const double* inner,
                                                    const HeldInner& held, const Vec3& point);

/// (pi(X) - u) / sigma over pose, inner parameters and point.
class ReprojectionCost final : public ceres::SizedCostFunction<2, 6, kIntrinsics, 3> {
 public:
  /// sigma: px. held: of the device.
  ReprojectionCost(const Vec2& pixel, double sigma, const HeldInner& held)
      : pixel_(pixel), sigma_(sigma), held_(held) {}
  bool Evaluate(const double* const* parameters, double* residual,
                double** jacobians) const override;

 private:
  Vec2 pixel_;
  double sigma_;
  HeldInner held_;
};

/// The same for a point of a board, over pose, inner parameters and the board's pose.
class BoardCost final : public ceres::SizedCostFunction<2, 6, kIntrinsics, 6> {
 public:
  BoardCost(const Vec2& pixel, double sigma, const HeldInner& held, const Vec2& position)
      : pixel_(pixel), sigma_(sigma), held_(held), position_(position) {}
  bool Evaluate(const double* const* parameters, double* residual,
                double** jacobians) const override;

 private:
  Vec2 pixel_;
  double sigma_;
  HeldInner held_;
  Vec2 position_;  ///< on the board
};

}  // namespace pencilscan
