#pragma once

#include <Eigen/Core>
#include <map>
#include <vector>

#include "pencilscan/calibration/bundle.h"

namespace pencilscan {

/// What the data say of the devices, points and poses of boards eliminated (Schur complement), 15
/// numbers to a device: a small rotation in its frame (x -> x + r x (R X)), a shift of t, and the
/// inner parameters.
///
/// Systematic errors enter as numbers that nobody estimates ("consider parameters"; B. D. Tapley,
/// B. E. Schutz, G. H. Born, "Statistical Orbit Determination", 2004, chapter 6): how far each of
/// them would push the estimates follows from the same derivatives.
class ReducedEquations {
 public:
  static constexpr Eigen::Index kPose = 6;
  static constexpr Eigen::Index kBlock = kPose + kIntrinsics;

  ReducedEquations(const BundleProblem& problem, unsigned free_inner, double loss_scale,
                   double extra_sigma_px);

  /// 15 D x 15 D.
  [[nodiscard]] const Eigen::MatrixXd& H() const { return H_; }
  [[nodiscard]] bool is_free(Eigen::Index i) const { return free_[static_cast<std::size_t>(i)]; }
  /// By what the inverse of H is too small or large: about 1 where the views' deviations are right.
  /// With weights w of the loss, psi = w r and E over all residuals r, the covariance of a robust
  /// estimate is E[psi'] ^-2 E[psi^2] (J'J)^-1 (P. J. Huber, "Robust Statistics", 1981, section
  /// 7.6), and H = E[w] J'J.
  [[nodiscard]] double variance_factor() const;
  /// Per column one systematic error of one standard deviation, as it enters H x = b; 15 D x N.
  /// Boards may be bent and stretched; `shared_px` is the error that all views in a ninth of an
  /// image share.
  [[nodiscard]] Eigen::MatrixXd systematic(double shared_px) const;

 private:
  using Block = Eigen::Matrix<double, 2, kBlock>;
  static constexpr int kPatches = 3;      ///< of an image along each side
  static constexpr int kBoardShapes = 5;  ///< stretch, shear, bend in three ways

  struct ViewRow {
    Eigen::Index device;
    Eigen::Index patch;  ///< column of patches_; -1 for a hub, which is exact
    double by_px;        ///< whitened residual of a pixel
    Block device_part;
    Eigen::Matrix<double, 2, 3> point_part;
  };
  [[nodiscard]] Eigen::Index count() const {
    return static_cast<Eigen::Index>(problem_.devices.size());
  }
  [[nodiscard]] ViewRow row_of(const ViewLinearization& view, const TrackView& seen,
                               const Vec3& point, bool is_hub) const;
  void add_to_loss(double squared, double freedom);
  void add_track(std::size_t t);
  void add_boards();
  void add_priors(unsigned free_inner);

  const BundleProblem& problem_;
  double loss_scale_;
  double extra_;
  Eigen::MatrixXd H_;
  Eigen::MatrixXd patches_;  ///< 15 D x (2 * 9 D), per pixel of shared error
  Eigen::MatrixXd shapes_;   ///< 15 D x 5, per deviation of the board's shape
  std::vector<Mat3> rotations_;
  std::vector<bool> free_;
  /// Sums over the degrees of freedom of all views.
  struct LossSums {
    double weight = 0;     ///< w
    double influence = 0;  ///< psi^2
    double slope = 0;      ///< psi'
  } loss_;
};

}  // namespace pencilscan
