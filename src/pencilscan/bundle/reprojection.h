#pragma once

#include <ceres/sized_cost_function.h>

#include <optional>

#include "pencilscan/bundle/bundle_device.h"

namespace pencilscan {

/// Where a device shows a point, px. Nothing at or behind the pinhole, where there is no sensible
/// pixel.
[[nodiscard]] std::optional<Vec2> shown_pixel(const double* pose, const double* inner,
                                              const HeldInner& held, const Vec3& point);

/// What a device saw of a point, and how surely.
struct SeenPixel {
  Vec2 pixel;
  double sigma;    ///< px
  HeldInner held;  ///< of the device
};

/// (pi(X) - u) / sigma over pose, inner parameters and point.
class ReprojectionCost final : public ceres::SizedCostFunction<2, 6, kIntrinsics, 3> {
 public:
  explicit ReprojectionCost(const SeenPixel& seen) : seen_(seen) {}
  bool Evaluate(const double* const* parameters, double* residual,
                double** jacobians) const override;

 private:
  SeenPixel seen_;
};

/// The same for a point of a board, over pose, inner parameters and the board's pose.
class BoardCost final : public ceres::SizedCostFunction<2, 6, kIntrinsics, 6> {
 public:
  BoardCost(const SeenPixel& seen, const Vec2& position) : seen_(seen), position_(position) {}
  bool Evaluate(const double* const* parameters, double* residual,
                double** jacobians) const override;

 private:
  SeenPixel seen_;
  Vec2 position_;  ///< on the board
};

}  // namespace pencilscan
