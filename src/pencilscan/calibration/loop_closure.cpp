#include "pencilscan/calibration/loop_closure.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/geometry/least_squares.h"

namespace pencilscan {
namespace {

/// Two devices adjusted by themselves.
struct RingStep {
  RigidTransform to_from_from;     ///< of the device it leads to; lengths in units of the step
  std::vector<std::size_t> track;  ///< of the result, per point
  std::vector<Vec3> in_from;       ///< points in the first device's frame
};

/// Devices by their direction from the middle of the points, in the plane that lies nearest to
/// them.
std::vector<std::size_t> round_the_middle(const BundleProblem& problem, double widest_step_rad) {
  const Vec3 middle = middle_of_points(problem);
  Eigen::MatrixXd spread = Eigen::MatrixXd::Zero(3, 3);
  std::vector<std::size_t> present;
  for (std::size_t d = 0; d < problem.devices.size(); ++d) {
    if (!problem.devices[d].present) continue;
    present.push_back(d);
    const Vec3 offset = center_of(problem.devices[d]) - middle;
    spread += offset * offset.transpose();
  }
  if (present.size() < 3) return {};
  const SymmetricEigen axes = symmetric_eigen(spread);
  std::vector<std::pair<double, std::size_t>> order;
  for (const std::size_t d : present) {
    const Vec3 offset = center_of(problem.devices[d]) - middle;
    order.emplace_back(
        std::atan2(offset.dot(Vec3(axes.vectors.col(1))), offset.dot(Vec3(axes.vectors.col(2)))),
        d);
  }
  std::sort(order.begin(), order.end());
  std::vector<std::size_t> devices;
  for (std::size_t i = 0; i < order.size(); ++i) {
    const auto& next = order[(i + 1) % order.size()];
    double gap = next.first - order[i].first;
    if (gap < 0) gap += 2 * std::numbers::pi;
    if (gap > widest_step_rad) return {};
    devices.push_back(order[i].second);
  }
  // Starts at the first device of the rig.
  std::rotate(devices.begin(), std::min_element(devices.begin(), devices.end()), devices.end());
  return devices;
}

std::optional<RingStep> make_step(const CalibrationResult& result, std::size_t from, std::size_t to,
                                  std::size_t least_matches) {
  const BundleProblem& all = result.problem;
  BundleProblem two;
  for (const std::size_t d : {from, to}) {
    two.devices.push_back(all.devices[d]);
    two.devices.back().prior_sigma.fill(0);
  }
  RingStep step;
  for (std::size_t t = 0; t < all.tracks.size(); ++t) {
    if (all.used[t] == 0) continue;
    Track track;
    for (TrackView view : all.tracks[t].views) {
      if (view.device != from && view.device != to) continue;
      view.device = view.device == from ? 0 : 1;
      track.views.push_back(view);
    }
    if (track.views.size() != 2) continue;
    two.tracks.push_back(std::move(track));
    two.points.push_back(all.points[t]);
    step.track.push_back(t);
  }
  if (two.tracks.size() < least_matches) return std::nullopt;
  two.used.assign(two.tracks.size(), 1);
  BundleOptions options;
  options.extra_sigma_px = result.adjustment.extra_sigma_px;
  adjust(two, options);
  const RigidTransform from_world = transform_from(two.devices[0].pose);
  step.to_from_from = transform_from(two.devices[1].pose) * from_world.inverse();
  for (const Vec3& point : two.points) step.in_from.push_back(from_world * point);
  return step;
}

/// Length in the next step's units over that in this one's, by points that both have.
std::optional<double> scale_between(const RingStep& step, const RingStep& next,
                                    std::size_t least_links) {
  std::vector<double> ratios;
  std::size_t j = 0;
  for (std::size_t i = 0; i < step.track.size(); ++i) {
    while (j < next.track.size() && next.track[j] < step.track[i]) ++j;
    if (j == next.track.size()) break;
    if (next.track[j] != step.track[i]) continue;
    ratios.push_back(next.in_from[j].norm() / (step.to_from_from * step.in_from[i]).norm());
  }
  if (ratios.size() < least_links) return std::nullopt;
  return upper_median(std::move(ratios));
}

}  // namespace

LoopClosure close_loop(const CalibrationResult& result, const LoopClosureOptions& options) {
  if (!result.solved) return {};
  const std::vector<std::size_t> ring = round_the_middle(result.problem, options.widest_step_rad);
  const std::size_t n = ring.size();
  std::vector<std::optional<RingStep>> steps(n);
  parallel_for(n, [&](std::size_t i) {
    steps[i] = make_step(result, ring[i], ring[(i + 1) % n], options.least_matches);
  });
  LoopClosure loop;
  if (n < 3 || std::any_of(steps.begin(), steps.end(), [](const auto& s) { return !s; }))
    return loop;
  Mat3 rotation = Mat3::Identity();
  Vec3 shift = Vec3::Zero();
  for (std::size_t i = 0; i < n; ++i) {
    const RingStep& step = *steps[i];
    const auto scale = scale_between(step, *steps[(i + 1) % n], options.least_links);
    if (!scale) return LoopClosure{};
    rotation = step.to_from_from.rotation * rotation;
    shift = *scale * (step.to_from_from.rotation * shift + step.to_from_from.translation);
    loop.scale *= *scale;
  }
  loop.devices = ring;
  loop.rotation_rad = Eigen::AngleAxisd(rotation).angle();
  Device first = result.rig.cameras.empty() ? Device{} : static_cast<Device>(result.rig.cameras[0]);
  set_device(result.problem.devices[ring[0]], first);
  double squares = 0;
  double squares_px = 0;
  std::size_t count = 0;
  for (const Vec3& x : steps[0]->in_from) {
    const Vec3 back = loop.scale * (rotation * x) + shift;
    if (!(x.z() > 0 && back.z() > 0)) continue;
    squares += (back - x).squaredNorm();
    squares_px += (first.pixel_from_device(back) - first.pixel_from_device(x)).squaredNorm();
    ++count;
  }
  const auto points = static_cast<double>(std::max<std::size_t>(count, 1));
  loop.gap = std::sqrt(squares / points);
  loop.gap_px = std::sqrt(squares_px / points);
  return loop;
}

std::optional<Finding> judge_loop(const CalibrationResult& result, const LoopClosure& loop,
                                  double most_px) {
  if (loop.devices.empty() || loop.gap_px <= most_px) return std::nullopt;
  return Finding{
      Grade::kDoubtful,
      "the ring does not close: once round it, each step by the correspondences of its "
      "own two devices, points come back " +
          formatted(loop.gap_px) + " px off in " + device_at(result.rig, loop.devices.front()).name,
      "look at the errors of the single devices, and add captures that neighbours share"};
}

}  // namespace pencilscan
