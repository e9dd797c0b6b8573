#include "pencilscan/bundle/bundle.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "pencilscan/bundle/board_corners.h"
#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/bundle/reprojection.h"
#include "pencilscan/core/check.h"
#include "pencilscan/core/evenly_picked.h"
#include "pencilscan/core/median.h"

namespace pencilscan {
namespace {

/// (p - p0) / sigma per inner parameter, fy's on fy / fx.
class PriorCost final : public ceres::SizedCostFunction<kIntrinsics, kIntrinsics> {
 public:
  using Values = std::array<double, kIntrinsics>;
  /// weight: 1 / sigma; 0 for none.
  PriorCost(const Values& value, const Values& weight) : value_(value), weight_(weight) {}

  bool Evaluate(const double* const* parameters, double* residual,
                double** jacobians) const override {
    const double* inner = parameters[0];
    for (std::size_t i = 0; i < kIntrinsics; ++i)
      residual[i] = ((i == kFy ? inner[kFy] / inner[kFx] : inner[i]) - value_[i]) * weight_[i];
    if (jacobians == nullptr || jacobians[0] == nullptr) return true;
    Eigen::Map<Eigen::Matrix<double, kIntrinsics, kIntrinsics, Eigen::RowMajor>> by(jacobians[0]);
    by.setZero();
    for (std::size_t i = 0; i < kIntrinsics; ++i)
      by(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(i)) = weight_[i];
    by(kFy, kFy) = weight_[kFy] / inner[kFx];
    by(kFy, kFx) = -weight_[kFy] * inner[kFy] / (inner[kFx] * inner[kFx]);
    return true;
  }

 private:
  Values value_;
  Values weight_;
};

double prior_weight(double sigma) { return sigma > 0 && std::isfinite(sigma) ? 1 / sigma : 0; }

/// Inner parameters that stay: not asked for, or known exactly.
std::vector<int> constant_inner(const BundleDevice& device, unsigned free_inner) {
  std::vector<int> constant;
  for (int i = 0; i < kIntrinsics; ++i) {
    const bool free = (free_inner >> static_cast<unsigned>(i) & 1U) != 0;
    if (!free || device.prior_sigma[static_cast<std::size_t>(i)] == 0) constant.push_back(i);
  }
  return constant;
}

class ProblemBuilder {
 public:
  ProblemBuilder(BundleProblem& from, const BundleOptions& options)
      : from_(from), options_(options), in_use_(from.devices.size(), 0) {
    ceres::Problem::Options settings;
    settings.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    problem_ = std::make_unique<ceres::Problem>(settings);
    loss_ = std::make_unique<ceres::CauchyLoss>(options.loss_scale);
    track_loss_ = std::make_unique<ceres::ScaledLoss>(loss_.get(), options.track_weight,
                                                      ceres::DO_NOT_TAKE_OWNERSHIP);
    ordering_ = std::make_shared<ceres::ParameterBlockOrdering>();
  }

  void add_tracks() {
    std::vector<std::size_t> chosen;
    for (std::size_t t = 0; t < from_.tracks.size(); ++t)
      if (from_.used[t] != 0) chosen.push_back(t);
    const std::size_t most = options_.max_tracks == 0 ? chosen.size() : options_.max_tracks;
    for (const std::size_t t : evenly_picked(chosen, most)) add_track(t);
  }

  void add_boards() {
    for (const BoardView& seen : from_.board_views) {
      BundleDevice& device = from_.devices[seen.view.device];
      if (!device.present) continue;
      auto* cost =
          new BoardCost({seen.view.pixel, sigma(seen.view), device.held}, seen.position_mm);
      add(cost, loss_.get(), seen.view.device, from_.board_poses[seen.board].data());
      ordering_->AddElementToGroup(from_.board_poses[seen.board].data(), 1);
    }
  }

  void add_devices() {
    std::size_t first = from_.devices.size();
    for (std::size_t d = 0; d < from_.devices.size(); ++d) {
      if (in_use_[d] == 0) continue;
      BundleDevice& device = from_.devices[d];
      add_prior(device);
      const std::vector<int> constant = constant_inner(device, options_.free_inner);
      if (constant.size() == kIntrinsics) {
        problem_->SetParameterBlockConstant(device.inner.data());
      } else if (!constant.empty()) {
        problem_->SetManifold(device.inner.data(),
                              new ceres::SubsetManifold(kIntrinsics, constant));
      }
      if (first == from_.devices.size() || !options_.free_poses)
        problem_->SetParameterBlockConstant(device.pose.data());
      if (first == from_.devices.size()) first = d;
      ordering_->AddElementToGroup(device.pose.data(), 1);
      ordering_->AddElementToGroup(device.inner.data(), 1);
    }
    if (options_.free_poses && !boards_join_devices(from_.board_views)) hold_scale(first);
  }

  /// Keeps the translation component that scaling the scene about the first device changes most.
  void hold_scale(std::size_t first) {
    if (first == from_.devices.size()) return;
    const Vec3 origin = center_of(from_.devices[first]);
    double farthest = 0;
    std::size_t device = first;
    int component = 0;
    for (std::size_t d = first + 1; d < from_.devices.size(); ++d) {
      if (in_use_[d] == 0) continue;
      const Vec3 offset = rotation_of(from_.devices[d]) * (center_of(from_.devices[d]) - origin);
      int largest = 0;
      const double size = offset.cwiseAbs().maxCoeff(&largest);
      if (size <= farthest) continue;
      farthest = size;
      device = d;
      component = 3 + largest;
    }
    if (device != first)
      problem_->SetManifold(from_.devices[device].pose.data(),
                            new ceres::SubsetManifold(6, {component}));
  }

  BundleSummary solve() {
    ceres::Solver::Options solver;
    solver.linear_solver_type = ceres::DENSE_SCHUR;
    solver.linear_solver_ordering = ordering_;
    solver.num_threads = 1;
    solver.max_num_iterations = options_.max_iterations;
    solver.function_tolerance = options_.function_tolerance;
    solver.parameter_tolerance = 1e-10;
    solver.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(solver, problem_.get(), &summary);
    const double cost =
        summary.IsSolutionUsable() ? summary.final_cost : std::numeric_limits<double>::infinity();
    return {cost, static_cast<int>(summary.iterations.size()), views_};
  }

  [[nodiscard]] bool empty() const { return views_ == 0; }

 private:
  [[nodiscard]] double sigma(const TrackView& view) const {
    return std::hypot(view.sigma_px, options_.extra_sigma_px);
  }

  void add(ceres::CostFunction* cost, ceres::LossFunction* loss, std::size_t d, double* last) {
    problem_->AddResidualBlock(cost, loss, from_.devices[d].pose.data(),
                               from_.devices[d].inner.data(), last);
    in_use_[d] = 1;
    ++views_;
  }

  void add_track(std::size_t t) {
    for (const TrackView& view : from_.tracks[t].views) {
      const BundleDevice& device = from_.devices[view.device];
      if (!device.present) continue;
      const bool is_hub = &view == from_.tracks[t].views.data();
      const double deviation = is_hub ? view.sigma_px : sigma(view);
      // The hub's pixel is no measurement but the place where the others were taken.
      add(new ReprojectionCost({view.pixel, deviation, device.held}),
          is_hub ? nullptr : track_loss_.get(), view.device, from_.points[t].data());
    }
    ordering_->AddElementToGroup(from_.points[t].data(), 0);
  }

  void add_prior(BundleDevice& device) {
    PriorCost::Values weight{};
    for (std::size_t i = 0; i < kIntrinsics; ++i) weight[i] = prior_weight(device.prior_sigma[i]);
    problem_->AddResidualBlock(new PriorCost(device.prior, weight), nullptr, device.inner.data());
  }

  BundleProblem& from_;
  const BundleOptions& options_;
  std::unique_ptr<ceres::LossFunction> loss_;
  std::unique_ptr<ceres::LossFunction> track_loss_;
  std::unique_ptr<ceres::Problem> problem_;
  std::shared_ptr<ceres::ParameterBlockOrdering> ordering_;
  std::vector<char> in_use_;
  std::size_t views_ = 0;
};

}  // namespace

BundleSummary adjust(BundleProblem& problem, const BundleOptions& options) {
  PENCILSCAN_CHECK(problem.points.size() == problem.tracks.size());
  PENCILSCAN_CHECK(problem.used.size() == problem.tracks.size());
  ProblemBuilder builder(problem, options);
  builder.add_tracks();
  builder.add_boards();
  if (builder.empty()) return {};
  builder.add_devices();
  return builder.solve();
}

Vec3 middle_of_points(const BundleProblem& problem) {
  std::array<std::vector<double>, 3> coordinates;
  for (std::size_t t = 0; t < problem.points.size(); ++t)
    if (problem.used[t] != 0)
      for (std::size_t k = 0; k < 3; ++k)
        coordinates[k].push_back(problem.points[t][static_cast<Eigen::Index>(k)]);
  Vec3 middle = Vec3::Zero();
  for (std::size_t k = 0; k < 3; ++k)
    middle[static_cast<Eigen::Index>(k)] = upper_median(std::move(coordinates[k]));
  return middle;
}

std::size_t present_devices(const BundleProblem& problem) {
  return static_cast<std::size_t>(std::count_if(problem.devices.begin(), problem.devices.end(),
                                                [](const BundleDevice& d) { return d.present; }));
}

std::optional<Vec2> view_error(const BundleDevice& device, const Vec3& point,
                               const TrackView& view) {
  const auto pixel = shown_pixel(device.pose.data(), device.inner.data(), device.held, point);
  if (!pixel) return std::nullopt;
  return *pixel - view.pixel;
}

ViewLinearization linearize(const BundleDevice& device, const Vec3& point, const TrackView& view,
                            double extra_sigma_px) {
  const ReprojectionCost cost({view.pixel, std::hypot(view.sigma_px, extra_sigma_px), device.held});
  ViewLinearization result;
  const std::array<const double*, 3> parameters{device.pose.data(), device.inner.data(),
                                                point.data()};
  std::array<double*, 3> jacobians{result.pose.data(), result.inner.data(), result.point.data()};
  PENCILSCAN_CHECK(cost.Evaluate(parameters.data(), result.residual.data(), jacobians.data()));
  return result;
}

}  // namespace pencilscan
