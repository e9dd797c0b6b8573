#pragma once

#include <limits>
#include <span>
#include <vector>

#include "pencilscan/geometry/types.h"
#include "pencilscan/refinement/correction.h"
#include "pencilscan/refinement/crossing_tracks.h"
#include "pencilscan/refinement/refine_rig.h"
#include "pencilscan/refinement/track_residual.h"

namespace pencilscan {

/// What one device alone, all others where they are, would have to do to let its crossings meet.
struct DeviceMove {
  std::size_t device = 0;  ///< cameras, then projectors
  std::size_t tracks = 0;  ///< crossings that it takes part in
  PoseCorrection correction;
  /// Median over its crossings of how far the correction moves them on its image: of a projector,
  /// across its lines, since nothing shows the rest. This is well determined where rotation and
  /// translation make good for each other.
  double shift_px = 0;
  double sigma_px = 0;  ///< one standard deviation of it that noise gives
  /// A move of the device that gains MovedDevicesOptions::smallest_gain, in any direction; infinite
  /// where too few crossings tell of it.
  double seen_from_px = std::numeric_limits<double>::infinity();
  /// What it takes off the cost of all crossings, in squared deviations of the residuals as they
  /// are before, the loss of correlated ones taken off.
  double gain = 0;
};

/// A device that is off by less is as calibrated; px. Lens models, curves and calibrations leave
/// some hundredths of a pixel, and the joint labels take errors of 0.3 px.
inline constexpr double kSmallestMovePx = 0.2;

struct MovedDevicesOptions {
  double smallest_px = kSmallestMovePx;
  /// And one that gains less. By chance alone the gain of six parameters is chi-squared with six
  /// degrees of freedom, which exceeds 40 once in two million.
  double smallest_gain = 40;
  /// An even subset is used, but of each group (DeviceMover) as many as give a device in an even
  /// share of them refine.min_tracks: what costs most is their time.
  std::size_t max_tracks = 6000;
  /// Where devices that stand far off were found, one per device, or empty: none. Their moves begin
  /// there, since steps from where the rig has them may not lead so far.
  RigCorrection start;
  RefineRigOptions refine;  ///< its deviations, loss and the fewest crossings
};

/// Moves one device at a time, all others staying, until the crossings that it takes part in meet
/// best: the robust cost of refine_rig.h. Crossings come in groups: of frames, say.
class DeviceMover {
 public:
  /// The rig and the tracks must outlive the mover.
  DeviceMover(const Rig& rig, std::span<const std::vector<CrossingTrack>> groups,
              const MovedDevicesOptions& options);

  /// The best correction of one device, all others as they are now, from the crossings of all
  /// groups.
  [[nodiscard]] DeviceMove alone(std::size_t device) const;

  /// The same from one group: (rotation_px, translation_mm) of the best place, and its inverse
  /// covariance; zero where the group has too few crossings of the device.
  struct Place {
    Vec6 motion = Vec6::Zero();
    Mat6 information = Mat6::Zero();
  };
  [[nodiscard]] Place place_in(std::size_t device, std::size_t group) const;

  /// How far a small motion with this covariance moves the device's crossings of all groups on its
  /// image, as DeviceMove has it, px.
  struct Shift {
    double px = 0;
    double sigma_px = 0;
  };
  [[nodiscard]] Shift shift_of(std::size_t device, const Vec6& motion,
                               const Mat6& covariance) const;

  /// What the device made worse no longer widens the deviations.
  void put_back(const DeviceMove& move);
  [[nodiscard]] std::size_t devices() const { return correction_.size(); }

 private:
  struct Normal;  ///< equations of one device
  struct Best;    ///< correction and its equations

  /// Among tracks_[begin] to tracks_[end - 1].
  [[nodiscard]] std::vector<std::size_t> tracks_of(std::size_t device, std::size_t begin,
                                                   std::size_t end) const;
  [[nodiscard]] std::vector<std::size_t> tracks_of(std::size_t device) const {
    return tracks_of(device, 0, tracks_.size());
  }
  [[nodiscard]] double residual_deviation() const;
  [[nodiscard]] Normal normal_of(const std::vector<std::size_t>& own, std::size_t device,
                                 const PoseCorrection& at) const;
  [[nodiscard]] Normal prior(std::size_t device, const PoseCorrection& at) const;
  [[nodiscard]] Best best_of(const std::vector<std::size_t>& own, std::size_t device) const;

  const Rig& rig_;
  const MovedDevicesOptions options_;
  RigCorrection start_;
  RigCorrection correction_;
  std::vector<CrossingTrack> tracks_;
  std::vector<std::size_t> group_begin_;  ///< where the tracks of each begin; then their number
  std::vector<TrackResidual> residuals_;
  double scale_ = 1;
};

}  // namespace pencilscan
