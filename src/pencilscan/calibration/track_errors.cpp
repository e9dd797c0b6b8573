#include "pencilscan/calibration/track_errors.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/core/median.h"

namespace pencilscan {

std::vector<double> track_errors(const BundleProblem& problem, const Track& track,
                                 const Vec3& point) {
  std::vector<double> errors;
  for (std::size_t i = 1; i < track.views.size(); ++i) {
    const BundleDevice& device = problem.devices[track.views[i].device];
    if (!device.present) continue;
    const auto error = view_error(device, point, track.views[i]);
    if (error) errors.push_back(error->norm());
  }
  return errors;
}

double error_scale(const BundleProblem& problem) {
  std::vector<double> errors;
  for_each_residual(problem, [&](std::size_t t, const TrackView&, const Vec2& error) {
    const double n = static_cast<double>(problem.tracks[t].views.size()) - 1;
    for (Eigen::Index k = 0; k < 2; ++k)
      errors.push_back(std::abs(error[k]) * std::sqrt(2 * n / (2 * n - 1)));
  });
  return kDeviationPerMedian * lower_quantile(errors, 0.5);
}

double outlier_limit(const BundleProblem& problem, double deviations) {
  return std::max(deviations * error_scale(problem), 0.3);
}

double contradiction_limit(double usual_px) { return std::max(2.0, 8 * usual_px); }

double median_sigma(const BundleProblem& problem) {
  std::vector<double> sigmas;
  for (const Track& track : problem.tracks)
    for (std::size_t i = 1; i < track.views.size(); ++i) sigmas.push_back(track.views[i].sigma_px);
  return lower_quantile(sigmas, 0.5);
}

std::size_t drop_outliers(BundleProblem& problem, double limit) {
  std::size_t dropped = 0;
  for (std::size_t t = 0; t < problem.tracks.size(); ++t) {
    if (problem.used[t] == 0) continue;
    auto& views = problem.tracks[t].views;
    const auto is_wrong = [&](const TrackView& view) {
      const BundleDevice& device = problem.devices[view.device];
      if (!device.present) return false;
      const auto error = view_error(device, problem.points[t], view);
      return !error || error->norm() > limit;
    };
    const auto keep = std::stable_partition(views.begin() + 1, views.end(),
                                            [&](const TrackView& v) { return !is_wrong(v); });
    dropped += static_cast<std::size_t>(views.end() - keep);
    views.erase(keep, views.end());
    const auto present = std::count_if(views.begin(), views.end(), [&](const TrackView& v) {
      return problem.devices[v.device].present;
    });
    if (present < 2 || !problem.devices[views[0].device].present) problem.used[t] = 0;
  }
  return dropped;
}

}  // namespace pencilscan
