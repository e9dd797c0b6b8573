#include "pencilscan/refinement/refine_rig.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>

#include "pencilscan/core/evenly_picked.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/geometry/least_squares.h"
#include "pencilscan/refinement/determinacy.h"
#include "pencilscan/refinement/prior_scale.h"
#include "pencilscan/refinement/track_residual.h"

namespace pencilscan {
namespace {

using Parameters = std::array<double, 6>;  ///< of one device, in prior standard deviations

/// Prior standard deviations of every device.
struct Scales {
  std::vector<double> rotation_px;     ///< per device
  std::vector<double> translation_mm;  ///< likewise
  std::vector<double> mm_per_px;       ///< likewise: of the volume's centre in its image

  /// `likely`: of these, what they are for devices that did not move.
  Scales(const Rig& rig, const RefineRigOptions& options, double likely = 1)
      : rotation_px(device_count(rig), likely * options.rotation_sigma_px) {
    const Vec3 center = working_volume(rig).center;
    for (std::size_t d = 0; d < device_count(rig); ++d) {
      const Device& device = device_at(rig, d);
      mm_per_px.push_back((device.center() - center).norm() / device.focal_px());
      translation_mm.push_back(likely * options.translation_sigma_px * mm_per_px.back());
    }
    for (const std::size_t d : options.moved) {
      rotation_px[d] *= kMovedFarther / likely;
      translation_mm[d] *= kMovedFarther / likely;
    }
  }
  [[nodiscard]] PoseCorrection correction(std::size_t device, const double* p) const {
    return {rotation_px[device] * Vec3(p[0], p[1], p[2]),
            translation_mm[device] * Vec3(p[3], p[4], p[5])};
  }
  [[nodiscard]] Parameters parameters(std::size_t device, const PoseCorrection& c) const {
    const Vec3 r = c.rotation_px / rotation_px[device];
    const Vec3 t = c.translation_mm / translation_mm[device];
    return {r.x(), r.y(), r.z(), t.x(), t.y(), t.z()};
  }
  /// One per parameter of all devices.
  [[nodiscard]] Eigen::VectorXd all() const {
    Eigen::VectorXd values(6 * static_cast<Eigen::Index>(translation_mm.size()));
    for (std::size_t d = 0; d < translation_mm.size(); ++d) {
      const auto row = 6 * static_cast<Eigen::Index>(d);
      values.segment<3>(row).setConstant(rotation_px[d]);
      values.segment<3>(row + 3).setConstant(translation_mm[d]);
    }
    return values;
  }
};

class TrackCost : public ceres::CostFunction {
 public:
  TrackCost(const TrackResidual& residual, const Scales& scales)
      : residual_(residual), scales_(scales) {
    set_num_residuals(residual.rows());
    mutable_parameter_block_sizes()->assign(residual.devices().size(), 6);
  }

  bool Evaluate(const double* const* parameters, double* residuals,
                double** jacobians) const override {
    const std::size_t devices = residual_.devices().size();
    std::vector<PoseCorrection> poses;
    for (std::size_t d = 0; d < devices; ++d)
      poses.push_back(scales_.correction(residual_.devices()[d], parameters[d]));
    const auto value = residual_.evaluate(poses, jacobians != nullptr);
    if (!value) return false;
    Eigen::Map<Eigen::VectorXd>(residuals, residual_.rows()) = value->residual;
    if (jacobians == nullptr) return true;
    for (std::size_t d = 0; d < devices; ++d) {
      if (jacobians[d] == nullptr) continue;
      Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 6, Eigen::RowMajor>> out(
          jacobians[d], residual_.rows(), 6);
      out = value->jacobian.middleCols<6>(6 * static_cast<Eigen::Index>(d));
      out.leftCols<3>() *= scales_.rotation_px[residual_.devices()[d]];
      out.rightCols<3>() *= scales_.translation_mm[residual_.devices()[d]];
    }
    return true;
  }

 private:
  const TrackResidual& residual_;
  const Scales& scales_;
};

/// The parameters themselves: they are in prior standard deviations.
class PriorCost : public ceres::SizedCostFunction<6, 6> {
 public:
  bool Evaluate(const double* const* parameters, double* residuals,
                double** jacobians) const override {
    std::copy_n(parameters[0], 6, residuals);
    if (jacobians != nullptr && jacobians[0] != nullptr)
      Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(jacobians[0]).setIdentity();
    return true;
  }
};

std::vector<PoseCorrection> poses_of(const TrackResidual& residual, const Scales& scales,
                                     const std::vector<Parameters>& parameters) {
  std::vector<PoseCorrection> poses;
  for (const std::size_t d : residual.devices())
    poses.push_back(scales.correction(d, parameters[d].data()));
  return poses;
}

/// Median over tracks of the residual's length over what it would be with the stated deviations
/// (the median of chi-squared with k degrees of freedom is about k (1 - 2 / 9k)^3).
double residual_scale(const std::vector<TrackResidual>& residuals,
                      std::span<const CrossingTrack> tracks, const Scales& scales,
                      const std::vector<Parameters>& parameters) {
  std::vector<double> ratios(residuals.size());
  parallel_for(residuals.size(), [&](std::size_t t) {
    const auto value = residuals[t].evaluate(poses_of(residuals[t], scales, parameters), false);
    const double k = tracks[t].redundancy();
    ratios[t] =
        value ? std::sqrt(value->residual.squaredNorm() / (k * std::pow(1 - 2 / (9 * k), 3))) : 1e9;
  });
  return upper_median(std::move(ratios));
}

/// One robust solution at a fixed scale of the residuals.
void minimize(const std::vector<TrackResidual>& residuals, std::span<const CrossingTrack> tracks,
              const Scales& scales, double scale, const RefineRigOptions& options,
              std::vector<Parameters>& parameters) {
  ceres::Problem::Options problem_options;
  problem_options.loss_function_ownership = ceres::TAKE_OWNERSHIP;
  ceres::Problem problem(problem_options);
  for (std::size_t t = 0; t < residuals.size(); ++t) {
    std::vector<double*> blocks;
    for (const std::size_t d : residuals[t].devices()) blocks.push_back(parameters[d].data());
    const double bound = options.loss_scale * scale * std::sqrt(tracks[t].redundancy());
    auto* loss = new ceres::ScaledLoss(new ceres::CauchyLoss(bound),
                                       1 / (options.correlated_crossings * scale * scale),
                                       ceres::TAKE_OWNERSHIP);
    problem.AddResidualBlock(new TrackCost(residuals[t], scales), loss, blocks);
  }
  for (Parameters& p : parameters) problem.AddResidualBlock(new PriorCost, nullptr, p.data());
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  solver.num_threads = 1;  // sums of more differ from run to run
  solver.max_num_iterations = options.max_iterations;
  solver.function_tolerance = 1e-7;
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
}

/// J'J over the tracks with robust weights, in units of the priors; points eliminated.
Eigen::MatrixXd information(const std::vector<TrackResidual>& residuals,
                            std::span<const CrossingTrack> tracks, const Scales& scales,
                            double scale, const RefineRigOptions& options,
                            const std::vector<Parameters>& parameters) {
  const auto size = 6 * static_cast<Eigen::Index>(parameters.size());
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(size, size);
  for (std::size_t t = 0; t < residuals.size(); ++t) {
    const auto value = residuals[t].evaluate(poses_of(residuals[t], scales, parameters), true);
    if (!value) continue;
    const double bound = options.loss_scale * scale * std::sqrt(tracks[t].redundancy());
    const double weight = 1 / (1 + value->residual.squaredNorm() / (bound * bound)) /
                          (options.correlated_crossings * scale * scale);
    const Eigen::MatrixXd part = weight * value->jacobian.transpose() * value->jacobian;
    const auto& devices = residuals[t].devices();
    for (std::size_t i = 0; i < devices.size(); ++i) {
      for (std::size_t j = 0; j < devices.size(); ++j) {
        sum.block<6, 6>(6 * static_cast<Eigen::Index>(devices[i]),
                        6 * static_cast<Eigen::Index>(devices[j])) +=
            part.block<6, 6>(6 * static_cast<Eigen::Index>(i), 6 * static_cast<Eigen::Index>(j));
      }
    }
  }
  const Eigen::VectorXd unit = scales.all();
  return unit.asDiagonal() * sum * unit.asDiagonal();
}

/// Devices of a track, as indices of a RigCorrection.
std::vector<std::size_t> devices_of(const Rig& rig, const CrossingTrack& track) {
  std::vector<std::size_t> devices;
  for (const CrossingSighting& s : track.sightings)
    devices.push_back(static_cast<std::size_t>(s.camera));
  for (const LineOfProjector& line : track.lines)
    devices.push_back(rig.cameras.size() + static_cast<std::size_t>(line.projector));
  std::sort(devices.begin(), devices.end());
  devices.erase(std::unique(devices.begin(), devices.end()), devices.end());
  return devices;
}

struct UsedTracks {
  std::vector<CrossingTrack> tracks;
  std::vector<std::size_t> per_device;
  std::vector<char> is_refined;  ///< per device
};

/// Devices with enough tracks, and the tracks of such devices alone: an uncorrected device would
/// pull the others to itself.
UsedTracks usable(const Rig& rig, std::span<const CrossingTrack> tracks,
                  const RefineRigOptions& options) {
  UsedTracks used;
  used.is_refined.assign(device_count(rig), 1);
  std::vector<std::size_t> kept;
  for (bool changed = true; changed;) {
    changed = false;
    kept.clear();
    used.per_device.assign(device_count(rig), 0);
    for (std::size_t t = 0; t < tracks.size(); ++t) {
      const auto devices = devices_of(rig, tracks[t]);
      if (!std::all_of(devices.begin(), devices.end(),
                       [&](std::size_t d) { return used.is_refined[d] != 0; }))
        continue;
      kept.push_back(t);
      for (const std::size_t d : devices) ++used.per_device[d];
    }
    for (std::size_t d = 0; d < used.is_refined.size(); ++d) {
      if (used.is_refined[d] == 0 ||
          used.per_device[d] >= static_cast<std::size_t>(options.min_tracks))
        continue;
      used.is_refined[d] = 0;
      changed = true;
    }
  }
  for (const std::size_t t : evenly_picked(kept, options.max_tracks))
    used.tracks.push_back(tracks[t]);
  return used;
}

/// Why the equations are too few; empty when they are not.
std::string lack_of_equations(const UsedTracks& used, const RefineRigOptions& options) {
  const auto devices = std::count(used.is_refined.begin(), used.is_refined.end(), 1);
  if (used.tracks.empty())
    return "no device has " + std::to_string(options.min_tracks) +
           " crossings of labelled lines of two patterns";
  double redundancy = 0;
  for (const CrossingTrack& track : used.tracks) redundancy += track.redundancy();
  const double wanted = options.min_redundancy * 6 * static_cast<double>(devices);
  if (redundancy >= wanted) return {};
  return "the crossings give " + std::to_string(static_cast<int>(redundancy)) + " equations for " +
         std::to_string(6 * devices) + " pose parameters; at least " +
         std::to_string(static_cast<int>(std::ceil(wanted))) + " are needed";
}

/// The adjustment of one rig to its tracks.
class Adjustment {
 public:
  Adjustment(const Rig& rig, const UsedTracks& used, const RigCorrection& start,
             const RefineRigOptions& options)
      : rig_(rig),
        options_(options),
        scales_(rig, options),
        parameters_(device_count(rig), Parameters{}) {
    for (std::size_t d = 0; d < start.size(); ++d)
      if (used.is_refined[d] != 0) parameters_[d] = scales_.parameters(d, start[d]);
    for (const CrossingTrack& track : used.tracks) {
      const TrackResidual residual(rig, track, options.line_sigma_px);
      if (residual.evaluate(poses_of(residual, scales_, parameters_), false))
        tracks_.push_back(track);
    }
    for (const CrossingTrack& track : tracks_)
      residuals_.emplace_back(rig, track, options.line_sigma_px);
    find_scale();
  }

  /// The scale of the residuals shrinks as the devices find their places, and with it the bound
  /// beyond which a track loses its say.
  void settle() {
    for (int stage = 0; stage < options_.max_stages; ++stage) {
      const double before = scale_;
      minimize(residuals_, tracks_, scales_, scale_, options_, parameters_);
      find_scale();
      if (scale_ > 0.95 * before) break;
    }
    told_ = information(residuals_, tracks_, scales_, scale_, options_, parameters_);
  }

  /// Settles again with priors as large as the crossings say that calibration errors are.
  void settle_with_likely_priors() {
    Eigen::VectorXd found(size());
    for (std::size_t d = 0; d < parameters_.size(); ++d)
      found.segment<6>(6 * static_cast<Eigen::Index>(d)) =
          Eigen::Map<const Vec6>(parameters_[d].data());
    std::vector<Eigen::Index> moved;
    for (const std::size_t d : options_.moved)
      for (Eigen::Index k = 0; k < 6; ++k) moved.push_back(6 * static_cast<Eigen::Index>(d) + k);
    const double likely = likely_prior_scale(told_, found, moved);
    if (likely == 1) return;
    const RigCorrection so_far = correction();
    scales_ = Scales(rig_, options_, likely);
    for (std::size_t d = 0; d < so_far.size(); ++d)
      parameters_[d] = scales_.parameters(d, so_far[d]);
    settle();
  }

  [[nodiscard]] RigCorrection correction() const {
    RigCorrection correction;
    for (std::size_t d = 0; d < parameters_.size(); ++d)
      correction.push_back(scales_.correction(d, parameters_[d].data()));
    return correction;
  }
  /// Of the line coordinate, by the priors, and by what tracks leave of them. Devices without
  /// crossings keep their error, but no line of theirs is looked at here.
  [[nodiscard]] double expected_error_px() const { return error_px(identity()); }
  [[nodiscard]] double remaining_error_px() const {
    return error_px(solve_symmetric(identity() + told_, identity()));
  }
  [[nodiscard]] double scale_as_found() const { return found_scale_; }
  [[nodiscard]] const std::vector<CrossingTrack>& tracks() const { return tracks_; }
  [[nodiscard]] double mm_per_px(std::size_t device) const { return scales_.mm_per_px[device]; }

 private:
  [[nodiscard]] Eigen::Index size() const {
    return 6 * static_cast<Eigen::Index>(parameters_.size());
  }
  [[nodiscard]] Eigen::MatrixXd identity() const {
    return Eigen::MatrixXd::Identity(size(), size());
  }
  void find_scale() {
    found_scale_ = residual_scale(residuals_, tracks_, scales_, parameters_);
    scale_ = std::max(kLeastResidualScale, found_scale_);
  }
  /// `covariance`: in units of the priors.
  [[nodiscard]] double error_px(const Eigen::MatrixXd& covariance) const {
    const Eigen::VectorXd unit = scales_.all();
    return line_error_px(rig_, tracks_, unit.asDiagonal() * covariance * unit.asDiagonal(),
                         unit.cwiseAbs2().cwiseInverse());
  }

  const Rig& rig_;
  const RefineRigOptions& options_;
  Scales scales_;
  std::vector<Parameters> parameters_;
  std::vector<CrossingTrack> tracks_;  ///< with a residual where devices stand at the start
  std::vector<TrackResidual> residuals_;
  double found_scale_ = 1;  ///< of the residuals
  double scale_ = 1;        ///< that they are weighed with
  Eigen::MatrixXd told_;    ///< by the tracks where all has settled, in units of the priors
};

}  // namespace

RefineRigResult refine_rig(const Rig& calibrated, std::span<const CrossingTrack> tracks,
                           const RigCorrection& start, const RefineRigOptions& options) {
  const std::size_t devices = device_count(calibrated);
  RefineRigResult result;
  result.correction.resize(devices);
  const UsedTracks used = usable(calibrated, tracks, options);
  RefineRigReport& report = result.report;
  for (std::size_t d = 0; d < devices; ++d)
    report.devices.push_back({device_at(calibrated, d).name, used.per_device[d]});
  report.reason = lack_of_equations(used, options);
  if (!report.reason.empty()) return result;

  Adjustment adjustment(calibrated, used, start, options);
  adjustment.settle();
  report.expected_error_px = adjustment.expected_error_px();
  report.remaining_error_px = adjustment.remaining_error_px();
  const bool is_determined =
      report.remaining_error_px <= options.max_remaining * report.expected_error_px;
  if (is_determined) {
    adjustment.settle_with_likely_priors();
    report.remaining_error_px = adjustment.remaining_error_px();
  }
  report.residual_scale = adjustment.scale_as_found();
  const RigCorrection correction = adjustment.correction();
  report.tracks = adjustment.tracks().size();
  for (const CrossingTrack& track : adjustment.tracks()) report.sightings += track.sightings.size();
  report.before = crossing_disagreement(calibrated, adjustment.tracks());
  report.after = crossing_disagreement(corrected_rig(calibrated, correction), adjustment.tracks());
  if (!is_determined) {
    report.reason = "the crossings do not determine the devices: of an expected line error of " +
                    formatted(report.expected_error_px) + " px, " +
                    formatted(report.remaining_error_px) + " px would remain";
    return result;
  }
  report.refined = true;
  result.correction = correction;
  for (std::size_t d = 0; d < devices; ++d) {
    report.devices[d].refined = used.is_refined[d] != 0;
    report.devices[d].rotation_px = correction[d].rotation_px.norm();
    report.devices[d].translation_mm = correction[d].translation_mm.norm();
    report.devices[d].translation_px = report.devices[d].translation_mm / adjustment.mm_per_px(d);
  }
  return result;
}

}  // namespace pencilscan
