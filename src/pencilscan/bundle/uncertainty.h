#pragma once

#include <array>
#include <vector>

#include "pencilscan/bundle/bundle.h"

namespace pencilscan {

/// One standard deviation of everything that was estimated.
struct DeviceUncertainty {
  std::array<double, kIntrinsics> inner{};  ///< px, or as kIntrinsicNames; 0: held
  /// The data say little more than was known before: the value is that of the prior.
  std::array<bool, kIntrinsics> is_prior{};
  Vec3 rotation = Vec3::Zero();  ///< rad, about each axis of the device's frame
  Vec3 position = Vec3::Zero();  ///< of the centre per axis of the device's frame, rig units
};

struct Uncertainty {
  std::vector<DeviceUncertainty> devices;
  double variance_factor = 1;  ///< of the whitened residuals of correspondences
  double shared_px = 0;        ///< error that neighbours in an image share
  double track_weight = 1;     ///< what a correspondence should count, therefore
  /// Errors of points of the working volume, from the rig's own errors alone, after the similarity
  /// that fits best (poses of the whole rig and its scale mean nothing): root mean square per point
  /// over random rigs, then median and 95th percentile over points; rig units.
  double volume_median = 0;
  double volume_p95 = 0;
  double volume_radius = 0;  ///< of the points, 90th percentile of the distance to the middle
  /// Covariance, in that gauge, of the logarithm of the volume's size (the root mean square
  /// distance of its points from their mean), then of the devices' centres, three rows each
  /// (world, rig units; 0 where not present). What is exact between centres tells from it how well
  /// lengths are known. Empty without points.
  Eigen::MatrixXd size_and_centers;
};

/// Covariance from the Jacobian at the solution, points eliminated (Schur complement), in the free
/// network gauge: of all similarities of the rig, the one with the least sum of variances
/// (Triggs et al., "Bundle adjustment - a modern synthesis", 2000, section 9). Loss weights count.
/// Systematic errors widen it: those that neighbours share, as far as the residuals show them, over
/// a ninth of an image each; and where a board is used, its shape (reduced_equations.h).
/// Residuals show shared errors only in part (ReducedEquations::shared_error), which is made up
/// for.
[[nodiscard]] Uncertainty uncertainty(const BundleProblem& problem, const BundleOptions& adjusted,
                                      std::uint64_t seed = 1);

}  // namespace pencilscan
