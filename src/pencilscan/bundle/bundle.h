#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/bundle/observations.h"

namespace pencilscan {

struct BundleProblem {
  std::vector<BundleDevice> devices;
  std::vector<Track> tracks;
  std::vector<Vec3> points;  ///< of the tracks, in world
  std::vector<char> used;    ///< per track
  std::vector<BoardView> board_views;
  std::vector<std::array<double, 6>> board_poses;  ///< world_from_board
};

struct BundleOptions {
  /// Which inner parameters move (others keep their values); bit i is Intrinsic i.
  unsigned free_inner = 0;
  bool free_poses = true;
  double loss_scale = 2;      ///< of Cauchy's loss, in deviations, > 0
  double extra_sigma_px = 0;  ///< added to every view's deviation in squares, >= 0
  /// What a correspondence counts against priors and boards, in (0, 1]. Neighbours that share an
  /// error are no independent measurements (Uncertainty::track_weight).
  double track_weight = 1;
  int max_iterations = 50;
  double function_tolerance = 1e-6;  ///< relative change of the cost to stop at
  std::size_t max_tracks = 0;        ///< 0: all; else an even choice of these
};

struct BundleSummary {
  double cost = 0;  ///< half the robust sum of squares; infinite where it could not be taken
  int iterations = 0;
  std::size_t views = 0;
};

/// Minimises, over poses, chosen inner parameters and points,
///   sum_views w rho(|pi(X) - u|^2 / sigma^2) + sum_priors ((p - p0) / sigma_p)^2,
/// rho Cauchy's loss, w the track weight (1 for boards), by Levenberg-Marquardt with the points
/// eliminated (Ceres). The first present device's pose is held, and one coordinate of another for
/// the scale. One thread: sums of more differ from run to run.
BundleSummary adjust(BundleProblem& problem, const BundleOptions& options);

/// Reprojection error of a view, pixels; nothing when the point is behind the device.
[[nodiscard]] std::optional<Vec2> view_error(const BundleDevice& device, const Vec3& point,
                                             const TrackView& view);

/// visit(track index, view, error) for what present devices saw of the points in use; hubs, which
/// are exact, left out.
template <class Visit>
void for_each_residual(const BundleProblem& problem, Visit visit) {
  for (std::size_t t = 0; t < problem.points.size(); ++t) {
    if (problem.used[t] == 0) continue;
    const auto& views = problem.tracks[t].views;
    for (std::size_t i = 1; i < views.size(); ++i) {
      const BundleDevice& device = problem.devices[views[i].device];
      if (!device.present) continue;
      if (const auto error = view_error(device, problem.points[t], views[i]))
        visit(t, views[i], *error);
    }
  }
}

/// Of the coordinates of the points in use, the upper medians.
[[nodiscard]] Vec3 middle_of_points(const BundleProblem& problem);

/// Number of devices that have a pose.
[[nodiscard]] std::size_t present_devices(const BundleProblem& problem);

/// Residual and its derivatives of one view, whitened: d / d pose (2 x 6), inner (2 x 9) and point
/// (2 x 3), of the cost that adjust() uses (reprojection.h).
struct ViewLinearization {
  Vec2 residual = Vec2::Zero();
  Eigen::Matrix<double, 2, 6, Eigen::RowMajor> pose;
  Eigen::Matrix<double, 2, kIntrinsics, Eigen::RowMajor> inner;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> point;
};
[[nodiscard]] ViewLinearization linearize(const BundleDevice& device, const Vec3& point,
                                          const TrackView& view, double extra_sigma_px = 0);

}  // namespace pencilscan
