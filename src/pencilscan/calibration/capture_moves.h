#pragma once

#include <optional>
#include <vector>

#include "pencilscan/calibration/calibrate.h"

namespace pencilscan {

/// A device that stood elsewhere in one capture than the rig has it, or had another focal length.
struct CaptureMove {
  std::size_t device = 0;
  std::size_t capture = 0;
  double shift_px = 0;   ///< what its picture lies off by: median over its views
  double chance_px = 0;  ///< what errors of single views make of that, root mean square
  double gain = 0;       ///< what a pose of its own saves of the robust cost
};

/// Devices that moved, or were zoomed, between captures.
struct CaptureMoves {
  std::vector<CaptureMove> clear;
  /// What explains most, if anything lies off by more than single views err: where a device moved
  /// and the rig is a compromise, all devices lie off, and none clearly.
  std::optional<CaptureMove> likeliest;
};

/// In each capture each device gets a pose of its own, by a robust fit to all views, those that the
/// adjustment dropped too: it drops whatever a device that moved sees. A device has moved where its
/// picture then lies elsewhere by four deviations - what errors of single views make, times what
/// the median of all devices in all captures exceeds that by, since neighbours share errors - and
/// by what counts as a trend of errors (VerdictOptions::trend_px). Of several in a capture the one
/// whose pose explains most; the others are asked again without it. None of a single capture.
[[nodiscard]] CaptureMoves moved_between_captures(const CalibrationResult& result,
                                                  const std::vector<Track>& tracks);

[[nodiscard]] bool has_moved(const std::vector<CaptureMove>& moves, std::size_t device,
                             std::size_t capture);

/// Tracks without what devices saw in the captures in which they had moved.
[[nodiscard]] std::vector<Track> without_moved(const std::vector<Track>& tracks,
                                               const std::vector<CaptureMove>& moves);

}  // namespace pencilscan
