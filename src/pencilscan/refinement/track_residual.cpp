#include "pencilscan/refinement/track_residual.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "pencilscan/geometry/least_squares.h"

namespace pencilscan {

TrackResidual::TrackResidual(const Rig& calibrated, const CrossingTrack& track,
                             double line_sigma_px)
    : track_(&track) {
  const auto add = [&](std::size_t device) -> Observation& {
    auto slot = std::find(devices_.begin(), devices_.end(), device);
    if (slot == devices_.end()) slot = devices_.insert(slot, device);
    Observation& o = observations_.emplace_back();
    o.slot = static_cast<std::size_t>(slot - devices_.begin());
    o.device = &device_at(calibrated, device);
    return o;
  };
  for (const CrossingSighting& s : track.sightings) {
    Observation& o = add(static_cast<std::size_t>(s.camera));
    o.rows = 2;
    o.pixel = s.pixel;
    o.whitening = s.whitening;
  }
  for (const LineOfProjector& line : track.lines) {
    Observation& o = add(calibrated.cameras.size() + static_cast<std::size_t>(line.projector));
    o.rows = 1;
    o.pixel.setConstant(line.coordinate_px);
    o.whitening(0, static_cast<Eigen::Index>(line.axis)) = 1 / line_sigma_px;
  }
}

std::optional<TrackResidual::Value> TrackResidual::evaluate(std::span<const PoseCorrection> poses,
                                                            bool with_jacobian) const {
  std::vector<RigidTransform> device_from_world(devices_.size());
  for (const Observation& o : observations_)
    device_from_world[o.slot] = corrected_pose(*o.device, poses[o.slot]);
  Value value;
  value.point = track_->point;
  value.residual.resize(rows());
  Eigen::Matrix<double, Eigen::Dynamic, 3> by_point(rows(), 3);
  const auto linearize = [&]() -> bool {
    Eigen::Index row = 0;
    for (const Observation& o : observations_) {
      const Vec3 x = device_from_world[o.slot] * value.point;
      if (!(x.z() > 0)) return false;
      const Vec2 miss = o.whitening * (o.device->pixel_from_device(x) - o.pixel);
      const Eigen::Matrix<double, 2, 3> slope =
          o.whitening * projection_jacobian(*o.device, x) * device_from_world[o.slot].rotation;
      value.residual.segment(row, o.rows) = miss.head(o.rows);
      by_point.middleRows(row, o.rows) = slope.topRows(o.rows);
      row += o.rows;
    }
    return true;
  };
  // Gauss-Newton converges quadratically from a point that is a few pixels off.
  constexpr int kMaxIterations = 6;
  constexpr double kStepMm = 1e-7;
  for (int k = 0; k < kMaxIterations; ++k) {
    if (!linearize()) return std::nullopt;
    const Mat3 normal = by_point.transpose() * by_point;
    const Vec3 step = solve_symmetric(normal, -(by_point.transpose() * value.residual));
    if (!step.allFinite()) return std::nullopt;
    value.point += step;
    if (step.norm() < kStepMm) break;
  }
  if (!linearize()) return std::nullopt;
  if (!with_jacobian) return value;
  value.jacobian = Eigen::MatrixXd::Zero(rows(), 6 * static_cast<Eigen::Index>(devices_.size()));
  Eigen::Index row = 0;
  for (const Observation& o : observations_) {
    const Vec3 x = device_from_world[o.slot] * value.point;
    const Eigen::Matrix<double, 2, 6> slope = o.whitening * projection_jacobian(*o.device, x) *
                                              pose_jacobian(*o.device, poses[o.slot], x);
    value.jacobian.block(row, 6 * static_cast<Eigen::Index>(o.slot), o.rows, 6) =
        slope.topRows(o.rows);
    row += o.rows;
  }
  const Mat3 normal = by_point.transpose() * by_point;
  value.jacobian -= by_point * (normal.inverse() * (by_point.transpose() * value.jacobian));
  return value;
}

}  // namespace pencilscan
