#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "pencilscan/refinement/correction.h"
#include "pencilscan/refinement/crossing_tracks.h"

namespace pencilscan {

/// Whitened residual of one track as a function of the corrections of its devices, its point
/// solved for: 2 rows per sighting, then one per line.
class TrackResidual {
 public:
  TrackResidual(const Rig& calibrated, const CrossingTrack& track, double line_sigma_px);

  /// Devices that it depends on, each once, as indices of a RigCorrection.
  [[nodiscard]] const std::vector<std::size_t>& devices() const { return devices_; }
  [[nodiscard]] int rows() const { return static_cast<int>(2 * track_->sightings.size() + 2); }

  struct Value {
    Vec3 point = Vec3::Zero();
    Eigen::VectorXd residual;
    /// rows x 6 devices, the part that moving the point cannot make good: (I - J_x J_x^+) J_pose.
    Eigen::MatrixXd jacobian;
  };
  /// poses: one per devices(). Nothing when the point has no definite place before all devices.
  [[nodiscard]] std::optional<Value> evaluate(std::span<const PoseCorrection> poses,
                                              bool with_jacobian) const;

 private:
  struct Observation {
    std::size_t slot = 0;  ///< in devices_
    const Device* device = nullptr;
    int rows = 0;                                         ///< 2: camera, 1: projector
    Vec2 pixel = Vec2::Zero();                            ///< for a line: both its coordinate
    Eigen::Matrix2d whitening = Eigen::Matrix2d::Zero();  ///< for a line: one row used
  };

  const CrossingTrack* track_;
  std::vector<std::size_t> devices_;
  std::vector<Observation> observations_;
};

}  // namespace pencilscan
