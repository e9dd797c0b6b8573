#include "pencilscan/calibration/result_errors.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "pencilscan/bundle/board_corners.h"
#include "pencilscan/bundle/triangulation.h"
#include "pencilscan/calibration/track_errors.h"
#include "pencilscan/core/median.h"

namespace pencilscan {
namespace {

void measure_held_out(const CalibrationInput& input, const CalibrateOptions& options,
                      const PairFit& fit, CalibrationResult& result) {
  drop_epipolar_outliers(input.rig, result.pairs, options.least_inlier_share, result.held_out,
                         &fit);
  BundleProblem check;
  check.devices = result.problem.devices;
  check.tracks = result.held_out;
  triangulate_all(check, kLeastAngle);
  const double limit = outlier_limit(result.problem, options.outlier_deviations);
  BundleOptions points_only;
  points_only.free_poses = false;
  points_only.extra_sigma_px = result.adjustment.extra_sigma_px;
  points_only.max_iterations = 20;
  adjust(check, points_only);
  drop_outliers(check, limit);  // as for the others: wrong codes are no error of the rig
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t t = 0; t < check.tracks.size(); ++t) {
    if (check.used[t] == 0) continue;
    for (const double e : track_errors(check, check.tracks[t], check.points[t])) {
      sum += e * e;
      ++count;
    }
  }
  result.held_out_rms_px = std::sqrt(sum / static_cast<double>(count));  // not a number without any
}

}  // namespace

void measure_errors(const CalibrationInput& input, const CalibrateOptions& options,
                    const PairFit& fit, CalibrationResult& result) {
  const BundleProblem& problem = result.problem;
  std::vector<std::vector<double>> errors(problem.devices.size());
  double sum = 0;
  for_each_residual(problem, [&](std::size_t, const TrackView& view, const Vec2& error) {
    errors[view.device].push_back(error.norm());
    sum += error.squaredNorm();
    ++result.views;
  });
  result.rms_px = std::sqrt(sum / static_cast<double>(std::max<std::size_t>(result.views, 1)));
  for (std::size_t d = 0; d < errors.size(); ++d) {
    DeviceResiduals& r = result.residuals[d];
    r.views = errors[d].size();
    double squares = 0;
    for (const double e : errors[d]) squares += e * e;
    r.rms_px = std::sqrt(squares / static_cast<double>(std::max<std::size_t>(r.views, 1)));
    r.median_px = lower_quantile(errors[d], 0.5);
    r.p95_px = lower_quantile(errors[d], 0.95);
  }
  result.board_rms_px = board_rms_px(problem);
  measure_held_out(input, options, fit, result);
}

}  // namespace pencilscan
