#include "pencilscan/calibration/scale_deviation.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/bundle/board_corners.h"
#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/calibration/rig_frame.h"

namespace pencilscan {
namespace {

/// Deviation of the logarithm of the volume's size over that of the size of these devices'
/// centres, which a similarity takes from them: of centres c_i with mean c,
///   d log(size) = sum (c_i - c) . dc_i / sum |c_i - c|^2.
/// Of two that is their distance.
double share_if_exact(const BundleProblem& problem, const Uncertainty& uncertainty,
                      std::span<const std::size_t> devices) {
  Vec3 middle = Vec3::Zero();
  for (const std::size_t d : devices)
    middle += center_of(problem.devices[d]) / static_cast<double>(devices.size());
  double square_size = 0;
  for (const std::size_t d : devices)
    square_size += (center_of(problem.devices[d]) - middle).squaredNorm();
  // The rows of the covariance that it takes part in: of two devices seven, however many there are.
  std::vector<Eigen::Index> rows{0};
  std::vector<double> changes{1};
  for (const std::size_t d : devices) {
    const Vec3 change = -(center_of(problem.devices[d]) - middle) / square_size;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      rows.push_back(1 + 3 * static_cast<Eigen::Index>(d) + axis);
      changes.push_back(change[axis]);
    }
  }
  double variance = 0;
  for (std::size_t i = 0; i < rows.size(); ++i)
    for (std::size_t j = 0; j < rows.size(); ++j)
      variance += changes[i] * uncertainty.size_and_centers(rows[i], rows[j]) * changes[j];
  return std::sqrt(std::max(0.0, variance));
}

}  // namespace

std::optional<ScaleDeviation> scale_deviation(const CalibrationInput& input,
                                              const CalibrationResult& result,
                                              const Uncertainty& uncertainty) {
  using From = ScaleDeviation::From;
  const BundleProblem& problem = result.problem;
  const Eigen::MatrixXd& covariance = uncertainty.size_and_centers;
  if (!result.rig.unit_known || covariance.size() == 0) return std::nullopt;
  const auto is_present = [&](std::size_t d) { return problem.devices[d].present; };
  if (input.distance && is_present(input.distance->a) && is_present(input.distance->b)) {
    const std::vector<std::size_t> devices{input.distance->a, input.distance->b};
    return ScaleDeviation{From::kDistance, devices, share_if_exact(problem, uncertainty, devices)};
  }
  if (!problem.board_views.empty()) {
    if (!boards_join_devices(problem.board_views)) return std::nullopt;
    return ScaleDeviation{From::kBoard, {}, std::sqrt(std::max(0.0, covariance(0, 0)))};
  }
  std::vector<std::size_t> devices;
  for (std::size_t d = 0; d < problem.devices.size(); ++d)
    if (is_present(d) && input.known[d].pose) devices.push_back(d);
  if (devices.size() < 3) return std::nullopt;
  Eigen::Matrix3Xd found(3, devices.size());
  Eigen::Matrix3Xd given(3, devices.size());
  for (std::size_t i = 0; i < devices.size(); ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    found.col(column) = center_of(problem.devices[devices[i]]);
    given.col(column) = device_at(input.rig, devices[i]).center();
  }
  const double share =
      std::hypot(share_if_exact(problem, uncertainty, devices), pose_scale_deviation(found, given));
  return ScaleDeviation{From::kPoses, devices, share};
}

std::optional<ScaleDeviation> best_distance(const CalibrationResult& result,
                                            const Uncertainty& uncertainty) {
  if (uncertainty.size_and_centers.size() == 0) return std::nullopt;
  const BundleProblem& problem = result.problem;
  std::optional<ScaleDeviation> best;
  for (std::size_t b = 0; b < problem.devices.size(); ++b) {
    for (std::size_t a = 0; a < b; ++a) {
      if (!problem.devices[a].present || !problem.devices[b].present) continue;
      const std::vector<std::size_t> pair{a, b};
      const double share = share_if_exact(problem, uncertainty, pair);
      // Devices in one place have no distance.
      if (std::isfinite(share) && (!best || share < best->share))
        best = ScaleDeviation{ScaleDeviation::From::kDistance, pair, share};
    }
  }
  return best;
}

}  // namespace pencilscan
