#pragma once

#include <span>
#include <vector>

#include "pencilscan/refinement/correction.h"
#include "pencilscan/refinement/crossing_tracks.h"
#include "pencilscan/refinement/refine_rig.h"

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
  /// What it takes off the cost of all crossings, in squared deviations of the residuals as they
  /// are before, the loss of correlated ones taken off.
  double gain = 0;
};

struct MovedDevicesOptions {
  /// A device that is off by less is as calibrated; px. Lens models, curves and calibrations leave
  /// some hundredths of a pixel, and the joint labels take errors of 0.3 px.
  double smallest_px = 0.2;
  /// And one that gains less. By chance alone the gain of six parameters is chi-squared with six
  /// degrees of freedom, which exceeds 40 once in two million.
  double smallest_gain = 40;
  std::size_t max_tracks = 6000;  ///< an even subset is used
  /// Where devices that stand far off were found, one per device, or empty: none. Their moves begin
  /// there, since steps from where the rig has them may not lead so far.
  RigCorrection start;
  RefineRigOptions refine;  ///< its deviations, loss and the fewest crossings
};

struct MovedDevices {
  std::vector<DeviceMove> alone;  ///< per device: put back alone
  std::vector<DeviceMove> moved;  ///< those that have to be put back, the one that helps most first
};

/// Which devices stand elsewhere than the rig says. The one that takes most off the cost (the
/// robust sum of refine_rig.h) when it alone is put back is put back, and so on while one is off by
/// more than noise. So the fewest devices are accused: if all were free to move, as in
/// refine_rig(), they would share what one has done.
[[nodiscard]] MovedDevices find_moved_devices(const Rig& rig, std::span<const CrossingTrack> tracks,
                                              const MovedDevicesOptions& options = {});

/// The rig's correction in which these devices are put back; `devices`: of the rig.
[[nodiscard]] RigCorrection correction_of(std::span<const DeviceMove> moves, std::size_t devices);

}  // namespace pencilscan
