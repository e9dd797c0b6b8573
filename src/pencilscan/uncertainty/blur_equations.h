#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <map>
#include <span>
#include <vector>

#include "pencilscan/uncertainty/exposure_motion.h"

namespace pencilscan {

/// A rigid motion: shift, then turn in lengths at a distance of BlurColumns::reach().
constexpr int kTwist = 6;
using Twist = Eigen::Matrix<double, kTwist, 1>;

/// What blur sees of it, which knows no sign: products of its components, upper triangle by rows.
constexpr int kProducts = kTwist * (kTwist + 1) / 2;
using Products = Eigen::Matrix<double, kProducts, 1>;
[[nodiscard]] Products products(const Twist& m);

[[nodiscard]] double median_of(std::span<const LineBlur> lines, double LineBlur::*value);

/// The columns of the equations of all lines' variances: a baseline that knows nothing of motion,
/// then the products of the twist.
class BlurColumns {
 public:
  explicit BlurColumns(std::span<const LineBlur> lines);

  [[nodiscard]] Eigen::Index baseline() const { return baseline_; }
  [[nodiscard]] Eigen::Index count() const { return baseline_ + kProducts; }
  [[nodiscard]] const Vec3& pivot() const { return pivot_; }
  /// Root mean square distance of the places from the pivot: the unit of turns.
  [[nodiscard]] double reach() const { return reach_; }

  void row(std::size_t i, Eigen::VectorXd& values) const;

 private:
  std::span<const LineBlur> lines_;
  std::map<int, Eigen::Index> cameras_;
  std::map<int, Eigen::Index> projectors_;
  double spacing_, camera_depth_, projector_depth_;
  Vec3 pivot_ = Vec3::Zero();
  double reach_ = 1;
  Eigen::Index baseline_ = 0;
};

/// Normal equations S q = h.
struct BlurEquations {
  Eigen::MatrixXd S;
  Eigen::VectorXd h;

  explicit BlurEquations(Eigen::Index n)
      : S(Eigen::MatrixXd::Zero(n, n)), h(Eigen::VectorXd::Zero(n)) {}
  BlurEquations& operator+=(const BlurEquations& other);
  BlurEquations& operator-=(const BlurEquations& other);
  /// Of the last unknowns alone, the first `n` eliminated.
  [[nodiscard]] BlurEquations without_first(Eigen::Index n) const;
};

/// Equations of the products alone, the baseline eliminated.
struct MotionEquations {
  BlurEquations all;
  std::size_t pairs = 0;  ///< of camera and projector
  /// Without each pair, each camera and each projector: what they have in common may be no motion.
  /// Nothing of a kind of which there is one.
  std::array<std::vector<BlurEquations>, 3> without;
};

/// The variances of all lines over their deviations, with weights against outliers.
class BlurFit {
 public:
  explicit BlurFit(std::span<const LineBlur> lines);

  [[nodiscard]] const BlurColumns& columns() const { return columns_; }

  [[nodiscard]] MotionEquations equations() const;

  /// Variances, px^2, that the baseline with this motion has.
  [[nodiscard]] std::vector<double> expected(const Twist& m) const;

 private:
  /// Huber's weights over the noise, from fits of everything that is linear.
  void weigh();
  [[nodiscard]] BlurEquations sum(const std::vector<Eigen::Index>& members) const;

  std::span<const LineBlur> lines_;
  BlurColumns columns_;
  Eigen::MatrixXd rows_;    ///< over the deviations
  Eigen::VectorXd root_;    ///< 1 / deviation
  Eigen::VectorXd values_;  ///< variances over their deviations
  Eigen::VectorXd weight_;
  double noise_ = 1;
};

}  // namespace pencilscan
