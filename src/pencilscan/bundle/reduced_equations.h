#pragma once

#include <Eigen/Core>
#include <map>
#include <vector>

#include "pencilscan/bundle/bundle.h"

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
  static constexpr int kBoardShapes = 6;  ///< stretch, shear, bend in three ways, size
  static constexpr int kOfGivenK = 3;     ///< focal lengths; principal points along x and y

  ReducedEquations(const BundleProblem& problem, const BundleOptions& adjusted);

  /// 15 D x 15 D.
  [[nodiscard]] const Eigen::MatrixXd& H() const { return H_; }
  [[nodiscard]] bool is_free(Eigen::Index i) const { return free_[static_cast<std::size_t>(i)]; }
  /// By what the inverse of H is too small or large, at least 0.05: about 1 where the views'
  /// deviations are right. With weights w of the loss, psi = w r and E over all residuals r, the
  /// covariance of a robust estimate is E[psi'] ^-2 E[psi^2] (J'J)^-1 (P. J. Huber, "Robust
  /// Statistics", 1981, section 7.6), and H = E[w] J'J.
  [[nodiscard]] double variance_factor() const;
  /// Covariance of b in H x = b from errors of one view, corner or prior each; 15 D x 15 D. Of
  /// given K it has what each errs by alone.
  [[nodiscard]] Eigen::MatrixXd random() const;
  /// Per column one systematic error of one standard deviation, as it enters H x = b; 15 D x N.
  /// Boards may be bent and stretched; `shared_px` is the error that all views in a ninth of an
  /// image share. Given K err alike: they are of one target and one method.
  [[nodiscard]] Eigen::MatrixXd systematic(double shared_px) const;

  /// One standard deviation of the errors that views in a ninth of an image share, from what
  /// residuals show of them (visible_shared_variance). The rest is hidden: points took up what lies
  /// along epipolar lines, and the devices whatever looks like them. Of n numbers (two to a ninth)
  /// a share s is left, so the variance is 1 / s times that of the residuals; and as the mean of
  /// s n squares only, by another s n / (s n - 2) (that of Student's t; at most 3). `root` root' is
  /// the inverse of H in the rows that `is_free`.
  [[nodiscard]] double shared_error(const Eigen::MatrixXd& root) const;
  /// What each of n views in a ninth of an image should count, that share an error of `shared_px`
  /// beside their own of sigma: their mean errs by sigma^2 / n + shared^2, so 1 / (1 + n shared^2 /
  /// sigma^2); n as the average view has it.
  [[nodiscard]] double fair_track_weight(double shared_px) const;

 private:
  using Block = Eigen::Matrix<double, 2, kBlock>;
  static constexpr int kPatches = 3;  ///< of an image along each side
  static constexpr int kCells = 8;    ///< the same, to find errors that neighbours share

  enum class Counts { kExactly, kAsTrack, kAsCorner };  ///< exactly: a hub

  struct ViewRow {
    Eigen::Index device;
    Eigen::Index patch;  ///< column of patches_; -1 for a hub, which is exact
    Eigen::Index cell;   ///< column of cells_; -1 for a hub
    double by_px = 0;    ///< whitened residual of a pixel
    Vec2 residual;       ///< whitened
    Block device_part;
    Eigen::Matrix<double, 2, 3> point_part;
  };
  /// Sums over the views in a part of an image, each weighed by w = weight of the loss / sigma^2.
  struct Cell {
    Vec2 error = Vec2::Zero();  ///< of w times the error of a pixel
    double weight = 0;          ///< of w: by how much `error` grows with an error that all share
    double weight2 = 0;         ///< of w^2
    double squares = 0;         ///< of (w error)^2
    double freedom = 0;         ///< of w times the coordinates that points leave, of two
  };
  [[nodiscard]] Eigen::Index count() const {
    return static_cast<Eigen::Index>(problem_.devices.size());
  }
  [[nodiscard]] ViewRow row_of(const ViewLinearization& view, const TrackView& seen,
                               const Vec3& point, Counts counts) const;
  /// Variance per coordinate, px^2, of what views in a cell share, as residuals have it: what the
  /// means of cells scatter by beyond what the scatter within cells makes of them (one-way analysis
  /// of variance). Points and devices take up a part of that chance, too.
  [[nodiscard]] double visible_shared_variance(const Eigen::MatrixXd& root) const;
  /// Rows of the parameters that are free.
  [[nodiscard]] Eigen::MatrixXd free_rows(const Eigen::MatrixXd& all) const;
  void add_to_loss(double squared, double freedom);
  void add_track(std::size_t t);
  void add_boards();
  void add_priors();
  void add_given_K(Eigen::Index at, std::size_t intrinsic, double sigma);

  const BundleProblem& problem_;
  BundleOptions adjusted_;
  Eigen::MatrixXd H_;
  Eigen::MatrixXd of_tracks_;    ///< part of H that is from correspondences
  Eigen::MatrixXd patches_;      ///< 15 D x (2 * 9 D), per pixel of shared error
  Eigen::MatrixXd cells_;        ///< 15 D x (2 * 64 D), the same of cells
  std::vector<Cell> in_cells_;   ///< 64 D
  Eigen::MatrixXd shapes_;       ///< 15 D x 5, per deviation of the board's shape
  Eigen::MatrixXd of_given_K_;   ///< part of H that is from priors of given K, a diagonal
  Eigen::MatrixXd given_K_;      ///< 15 D x 3, per deviation of all given K at once
  Eigen::VectorXd patch_views_;  ///< per column of patches_: views, each over its sigma^2, px^-2
  double after_points_ = 0;      ///< shared errors of a pixel in whitened residuals, squared: left
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
