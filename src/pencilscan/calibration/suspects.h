#pragma once

#include <map>
#include <optional>
#include <vector>

#include "pencilscan/calibration/capture_moves.h"
#include "pencilscan/calibration/finding.h"
#include "pencilscan/calibration/pair_fit.h"
#include "pencilscan/calibration/pair_matches.h"

namespace pencilscan {

/// What contradicts a rig.
struct Contradictions {
  std::vector<Finding> findings;
  std::optional<std::size_t> mover;  ///< the device that the last of them says has moved
  /// Pairs that neither swapped folders nor moved devices explain, nor their own images (some fit
  /// no pair of devices at all), with the captures in which they contradict; none: in all.
  std::map<DevicePair, std::vector<std::size_t>> unexplained;
  /// Pairs whose folders were exchanged, with the captures in which they were; none: in all.
  std::map<DevicePair, std::vector<std::size_t>> swapped;
  CaptureMoves moves;
};

/// To ask whether correspondences agree with a rig: to 8 times its errors, 2 px at least.
[[nodiscard]] PairFit tolerant_fit(const CalibrationResult& result);

/// Pairs whose correspondences contradict the rig, explained: swapped folders, a device that moved
/// between projectors, or a scene that moved; and devices that moved between captures, whether
/// pairs contradict or the adjustment dropped what they saw.
[[nodiscard]] Contradictions find_contradictions(const CalibrationInput& input,
                                                 const CalibrationResult& result);

/// Tracks without the views of some pairs, in the captures stated or in all.
[[nodiscard]] std::vector<Track> without_pairs(
    const std::vector<Track>& tracks, const std::map<DevicePair, std::vector<std::size_t>>& pairs);

}  // namespace pencilscan
