#include "pencilscan/refinement/device_mover.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/core/evenly_picked.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/geometry/least_squares.h"

namespace pencilscan {
namespace {

Vec6 vector_of(const PoseCorrection& c) {
  Vec6 v;
  v << c.rotation_px, c.translation_mm;
  return v;
}

std::vector<PoseCorrection> poses(const TrackResidual& residual, const RigCorrection& correction) {
  std::vector<PoseCorrection> result;
  for (const std::size_t d : residual.devices()) result.push_back(correction[d]);
  return result;
}

}  // namespace

/// One device's normal equations, or what a track adds to them.
struct DeviceMover::Normal {
  Mat6 matrix = Mat6::Zero();
  Vec6 gradient = Vec6::Zero();
  double cost = 0;
};

struct DeviceMover::Best {
  PoseCorrection correction;
  Normal normal;
};

DeviceMover::DeviceMover(const Rig& rig, std::span<const std::vector<CrossingTrack>> groups,
                         const MovedDevicesOptions& options)
    : rig_(rig), options_(options), start_(options.start) {
  start_.resize(device_count(rig));
  correction_ = start_;
  const std::size_t enough =
      static_cast<std::size_t>(options.refine.min_tracks) * device_count(rig);
  const std::size_t of_group =
      std::max(options.max_tracks / std::max<std::size_t>(groups.size(), 1), enough);
  for (const std::vector<CrossingTrack>& group : groups) {
    group_begin_.push_back(tracks_.size());
    for (const CrossingTrack& track : evenly_picked(group, of_group)) {
      const TrackResidual residual(rig, track, options.refine.line_sigma_px);
      if (residual.evaluate(poses(residual, correction_), false)) tracks_.push_back(track);
    }
  }
  group_begin_.push_back(tracks_.size());
  for (const CrossingTrack& track : tracks_)
    residuals_.emplace_back(rig, track, options.refine.line_sigma_px);
  scale_ = std::max(1.0, residual_deviation());
}

std::vector<std::size_t> DeviceMover::tracks_of(std::size_t device, std::size_t begin,
                                                std::size_t end) const {
  std::vector<std::size_t> own;
  for (std::size_t t = begin; t < end; ++t) {
    const auto& devices = residuals_[t].devices();
    if (std::find(devices.begin(), devices.end(), device) != devices.end()) own.push_back(t);
  }
  return own;
}

DeviceMove DeviceMover::alone(std::size_t device) const {
  const std::vector<std::size_t> own = tracks_of(device);
  DeviceMove move;
  move.device = device;
  move.tracks = own.size();
  move.correction = correction_[device];
  if (own.size() < static_cast<std::size_t>(options_.refine.min_tracks)) return move;
  const double before =
      normal_of(own, device, options_.start.empty() ? correction_[device] : PoseCorrection{}).cost;
  const Best best = best_of(own, device);
  move.correction = best.correction;
  move.gain = before - best.normal.cost;
  const Shift shift =
      shift_of(device, vector_of(best.correction),
               solve_symmetric(Eigen::MatrixXd(best.normal.matrix), Mat6::Identity()));
  move.shift_px = shift.px;
  move.sigma_px = shift.sigma_px;
  move.seen_from_px =
      std::max(options_.smallest_px, std::sqrt(options_.smallest_gain) * shift.sigma_px);
  return move;
}

DeviceMover::Place DeviceMover::place_in(std::size_t device, std::size_t group) const {
  const std::vector<std::size_t> own =
      tracks_of(device, group_begin_[group], group_begin_[group + 1]);
  if (own.size() < static_cast<std::size_t>(options_.refine.min_tracks)) return {};
  const Best best = best_of(own, device);
  return {vector_of(best.correction), best.normal.matrix};
}

DeviceMover::Best DeviceMover::best_of(const std::vector<std::size_t>& own,
                                       std::size_t device) const {
  constexpr int kMaxIterations = 20;
  constexpr double kStepPx = 1e-4;
  Best best{correction_[device], normal_of(own, device, correction_[device])};
  for (int k = 0; k < kMaxIterations; ++k) {
    const Vec6 step = solve_symmetric(best.normal.matrix, Vec6(-best.normal.gradient));
    PoseCorrection next = best.correction;
    next.rotation_px += step.head<3>();
    next.translation_mm += step.tail<3>();
    Normal at_next = normal_of(own, device, next);
    if (!(at_next.cost < best.normal.cost)) break;
    best = {next, at_next};
    if (step.head<3>().norm() < kStepPx) break;
  }
  return best;
}

void DeviceMover::put_back(const DeviceMove& move) {
  correction_[move.device] = move.correction;
  scale_ = std::max(1.0, residual_deviation());
}

/// Median deviation of the residuals over the predicted one, as refine_rig() finds it.
double DeviceMover::residual_deviation() const {
  std::vector<double> ratios(residuals_.size());
  parallel_for(residuals_.size(), [&](std::size_t t) {
    const auto value = residuals_[t].evaluate(poses(residuals_[t], correction_), false);
    const double k = tracks_[t].redundancy();
    ratios[t] =
        value ? std::sqrt(value->residual.squaredNorm() / (k * std::pow(1 - 2 / (9 * k), 3))) : 1;
  });
  return upper_median(std::move(ratios));
}

DeviceMover::Normal DeviceMover::normal_of(const std::vector<std::size_t>& own, std::size_t device,
                                           const PoseCorrection& at) const {
  RigCorrection correction = correction_;
  correction[device] = at;
  std::vector<Normal> parts(own.size());
  parallel_for(own.size(), [&](std::size_t i) {
    const TrackResidual& residual = residuals_[own[i]];
    const double bound =
        options_.refine.loss_scale * scale_ * std::sqrt(tracks_[own[i]].redundancy());
    const double unit = 1 / (options_.refine.correlated_crossings * scale_ * scale_);
    const auto value = residual.evaluate(poses(residual, correction), true);
    // A point that has lost its place says no more than one far away.
    const double squared = value ? value->residual.squaredNorm() : 100 * bound * bound;
    parts[i].cost = unit * bound * bound * std::log1p(squared / (bound * bound));
    if (!value) return;
    const auto& devices = residual.devices();
    const auto slot = std::find(devices.begin(), devices.end(), device) - devices.begin();
    const auto own_part = value->jacobian.middleCols<6>(6 * slot);
    const double weight = unit / (1 + squared / (bound * bound));
    parts[i].matrix = weight * own_part.transpose() * own_part;
    parts[i].gradient = weight * own_part.transpose() * value->residual;
  });
  Normal sum = prior(device, at);
  for (const Normal& part : parts) {
    sum.matrix += part.matrix;
    sum.gradient += part.gradient;
    sum.cost += part.cost;
  }
  return sum;
}

/// Chooses among what the crossings cannot tell; far wider than calibrations err.
DeviceMover::Normal DeviceMover::prior(std::size_t device, const PoseCorrection& at) const {
  const Device& d = device_at(rig_, device);
  const double per_px = (d.center() - working_volume(rig_).center).norm() / d.focal_px();
  Vec6 precision;
  precision.head<3>().setConstant(1 /
                                  std::pow(kMovedFarther * options_.refine.rotation_sigma_px, 2));
  precision.tail<3>().setConstant(
      1 / std::pow(kMovedFarther * options_.refine.translation_sigma_px * per_px, 2));
  const Vec6 x = vector_of(at) - vector_of(start_[device]);
  Normal normal;
  normal.matrix = precision.asDiagonal();
  normal.gradient = precision.cwiseProduct(x);
  normal.cost = x.dot(normal.gradient);
  return normal;
}

DeviceMover::Shift DeviceMover::shift_of(std::size_t device, const Vec6& motion,
                                         const Mat6& covariance) const {
  const Device& moved = device_at(rig_, device);
  std::vector<double> shifts;
  std::vector<double> sigmas;
  for (const std::size_t t : tracks_of(device)) {
    const Vec3 x = moved.device_from_world * tracks_[t].point;
    if (!(x.z() > 0)) continue;
    const Eigen::Matrix<double, 2, 6> slope =
        projection_jacobian(moved, x) * pose_jacobian(moved, PoseCorrection{}, x);
    Vec2 shift = slope * motion;
    Vec2 variance = (slope * covariance * slope.transpose()).diagonal();
    if (device >= rig_.cameras.size()) {
      const auto p = static_cast<int>(device - rig_.cameras.size());
      const LineOfProjector& line =
          tracks_[t].lines[0].projector == p ? tracks_[t].lines[0] : tracks_[t].lines[1];
      const auto across = static_cast<Eigen::Index>(line.axis);
      shift[1 - across] = variance[1 - across] = 0;
    }
    shifts.push_back(shift.norm());
    sigmas.push_back(std::sqrt(variance.sum()));
  }
  if (shifts.empty()) return {};
  return {upper_median(std::move(shifts)), upper_median(std::move(sigmas))};
}

}  // namespace pencilscan
