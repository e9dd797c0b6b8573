#pragma once

#include <optional>
#include <span>
#include <vector>

#include "pencilscan/refinement/device_mover.h"

namespace pencilscan {

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

/// A device that did not stand still while frames were taken.
struct MoveBetweenFrames {
  std::size_t device = 0;  ///< cameras, then projectors
  std::size_t frame = 0;   ///< the first one in which it stands elsewhere than before
  double shift_px = 0;     ///< between both places, as DeviceMove has it
  double sigma_px = 0;
  double gain = 0;  ///< of two places over one, in squared deviations
};

/// Which device moved, and between which frames: of all devices and frames the pair for which two
/// places of this device, one before and one from this frame on, take most off the cost, where they
/// do so by more than noise and lie farther apart than a calibration errs; else nothing. `tracks`
/// has one entry per frame; only `devices` are looked at. Each frame's own best place is found
/// first; costs of several frames are taken for quadratic around these.
[[nodiscard]] std::optional<MoveBetweenFrames> find_move_between(
    const Rig& rig, std::span<const std::vector<CrossingTrack>> tracks,
    std::span<const std::size_t> devices, const MovedDevicesOptions& options = {});

}  // namespace pencilscan
