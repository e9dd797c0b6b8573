#include "pencilscan/refinement/moved_devices.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "pencilscan/core/evenly_picked.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/geometry/least_squares.h"
#include "pencilscan/refinement/track_residual.h"

namespace pencilscan {
namespace {

/// One device's normal equations, or what a track adds to them.
struct Normal {
  Mat6 matrix = Mat6::Zero();
  Vec6 gradient = Vec6::Zero();
  double cost = 0;
};

Vec6 vector_of(const PoseCorrection& c) {
  Vec6 v;
  v << c.rotation_px, c.translation_mm;
  return v;
}

class Mover {
 public:
  Mover(const Rig& rig, std::span<const CrossingTrack> tracks, const MovedDevicesOptions& options)
      : rig_(rig), options_(options), start_(options.start) {
    start_.resize(device_count(rig));
    correction_ = start_;
    for (const CrossingTrack& track : evenly_picked(tracks, options.max_tracks)) {
      const TrackResidual residual(rig, track, options.refine.line_sigma_px);
      if (residual.evaluate(poses(residual, correction_), false)) tracks_.push_back(track);
    }
    for (const CrossingTrack& track : tracks_)
      residuals_.emplace_back(rig, track, options.refine.line_sigma_px);
    scale_ = std::max(1.0, residual_deviation());
  }

  /// The best correction of one device, all others as they are now.
  [[nodiscard]] DeviceMove alone(std::size_t device) const {
    DeviceMove move;
    move.device = device;
    move.correction = correction_[device];
    std::vector<std::size_t> own;
    for (std::size_t t = 0; t < residuals_.size(); ++t) {
      const auto& devices = residuals_[t].devices();
      if (std::find(devices.begin(), devices.end(), device) != devices.end()) own.push_back(t);
    }
    move.tracks = own.size();
    if (own.size() < static_cast<std::size_t>(options_.refine.min_tracks)) return move;
    constexpr int kMaxIterations = 20;
    constexpr double kStepPx = 1e-4;
    Normal normal = normal_of(own, device, move.correction);
    const double before =
        options_.start.empty() ? normal.cost : normal_of(own, device, PoseCorrection{}).cost;
    for (int k = 0; k < kMaxIterations; ++k) {
      const Vec6 step = solve_symmetric(normal.matrix, Vec6(-normal.gradient));
      PoseCorrection next = move.correction;
      next.rotation_px += step.head<3>();
      next.translation_mm += step.tail<3>();
      Normal at_next = normal_of(own, device, next);
      if (!(at_next.cost < normal.cost)) break;
      move.correction = next;
      normal = at_next;
      if (step.head<3>().norm() < kStepPx) break;
    }
    move.gain = before - normal.cost;
    measure(own, normal.matrix, move);
    return move;
  }
  /// What it made worse no longer widens the deviations.
  void put_back(const DeviceMove& move) {
    correction_[move.device] = move.correction;
    scale_ = std::max(1.0, residual_deviation());
  }
  [[nodiscard]] std::size_t devices() const { return correction_.size(); }

 private:
  static std::vector<PoseCorrection> poses(const TrackResidual& residual,
                                           const RigCorrection& correction) {
    std::vector<PoseCorrection> result;
    for (const std::size_t d : residual.devices()) result.push_back(correction[d]);
    return result;
  }
  /// Median deviation of the residuals over the predicted one, as refine_rig() finds it.
  [[nodiscard]] double residual_deviation() const {
    std::vector<double> ratios(residuals_.size());
    parallel_for(residuals_.size(), [&](std::size_t t) {
      const auto value = residuals_[t].evaluate(poses(residuals_[t], correction_), false);
      const double k = tracks_[t].redundancy();
      ratios[t] =
          value ? std::sqrt(value->residual.squaredNorm() / (k * std::pow(1 - 2 / (9 * k), 3))) : 1;
    });
    return upper_median(std::move(ratios));
  }
  [[nodiscard]] Normal normal_of(const std::vector<std::size_t>& own, std::size_t device,
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
  [[nodiscard]] Normal prior(std::size_t device, const PoseCorrection& at) const {
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
  void measure(const std::vector<std::size_t>& own, const Mat6& information,
               DeviceMove& move) const {
    const Device& device = device_at(rig_, move.device);
    const bool is_camera = move.device < rig_.cameras.size();
    const Eigen::MatrixXd covariance =
        solve_symmetric(Eigen::MatrixXd(information), Eigen::MatrixXd::Identity(6, 6));
    std::vector<double> shifts;
    std::vector<double> sigmas;
    for (const std::size_t t : own) {
      const Vec3 x = device.device_from_world * tracks_[t].point;
      if (!(x.z() > 0)) continue;
      const Eigen::Matrix<double, 2, 6> slope =
          projection_jacobian(device, x) * pose_jacobian(device, PoseCorrection{}, x);
      Vec2 shift = slope * vector_of(move.correction);
      Vec2 variance = (slope * covariance * slope.transpose()).diagonal();
      if (!is_camera) {
        const auto p = static_cast<int>(move.device - rig_.cameras.size());
        const LineOfProjector& line =
            tracks_[t].lines[0].projector == p ? tracks_[t].lines[0] : tracks_[t].lines[1];
        const auto across = static_cast<Eigen::Index>(line.axis);
        shift[1 - across] = variance[1 - across] = 0;
      }
      shifts.push_back(shift.norm());
      sigmas.push_back(std::sqrt(variance.sum()));
    }
    move.shift_px = upper_median(std::move(shifts));
    move.sigma_px = upper_median(std::move(sigmas));
  }

  const Rig& rig_;
  const MovedDevicesOptions& options_;
  RigCorrection start_;
  RigCorrection correction_;
  std::vector<CrossingTrack> tracks_;
  std::vector<TrackResidual> residuals_;
  double scale_ = 1;
};

bool is_off(const DeviceMove& move, const MovedDevicesOptions& options) {
  return move.shift_px > options.smallest_px && move.gain > options.smallest_gain;
}

std::vector<DeviceMove> each_alone(const Mover& mover) {
  std::vector<DeviceMove> moves;
  for (std::size_t d = 0; d < mover.devices(); ++d) moves.push_back(mover.alone(d));
  return moves;
}

}  // namespace

MovedDevices find_moved_devices(const Rig& rig, std::span<const CrossingTrack> tracks,
                                const MovedDevicesOptions& options) {
  MovedDevices result;
  Mover mover(rig, tracks, options);
  result.alone = each_alone(mover);
  std::vector<DeviceMove> moves = result.alone;
  std::vector<char> is_accused(mover.devices(), 0);
  while (true) {
    // Those that are accused may still have to move a little further: only the others count.
    const DeviceMove* most = nullptr;
    for (const DeviceMove& move : moves) {
      if (is_accused[move.device] == 0 && is_off(move, options) &&
          (most == nullptr || move.gain > most->gain))
        most = &move;
    }
    if (most == nullptr) return result;
    is_accused[most->device] = 1;
    result.moved.push_back(*most);
    mover.put_back(*most);
    moves = each_alone(mover);
  }
}

RigCorrection correction_of(std::span<const DeviceMove> moves, std::size_t devices) {
  RigCorrection correction(devices);
  for (const DeviceMove& move : moves) correction[move.device] = move.correction;
  return correction;
}

}  // namespace pencilscan
