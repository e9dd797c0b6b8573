#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/core/progress.h"
#include "pencilscan/pipeline/rig_fit.h"

namespace pencilscan {

/// Frames between which no device moved.
struct RigPeriod {
  std::size_t first = 0;  ///< of the frames given
  std::size_t last = 0;
  RigFit fit;  ///< of these frames
  /// What moved between the period before and this one, where crossings tell it.
  std::optional<MoveBetweenFrames> moved_before;  ///< its frame: `first`
};

/// Whether a rig still fits frames, in the order of time, between which devices may move: as many
/// periods as crossings (find_move_between) or names tell apart, at least one. Names tell it where
/// in one frame half of those are lost, or come again, that a device has in the next one, and most
/// of what is seen of it has none in one of both: it then stands so far off that crossings say
/// nothing.
[[nodiscard]] std::vector<RigPeriod> check_rig_over_frames(const Rig& rig,
                                                           std::span<const FrameCurves> frames,
                                                           const MovedDevicesOptions& options = {},
                                                           const Progress& progress = {});

/// What is said of all frames: "moved meanwhile" where crossings tell that a device moved between
/// two periods, or other devices are to be put back in the one than in the other; else the worst of
/// to_string(RigVerdict).
[[nodiscard]] std::string verdict_of(std::span<const RigPeriod> periods);

/// "frame 000003", "frames 000000 to 000002". `names`: of the frames that were checked.
[[nodiscard]] std::string frames_of(const RigPeriod& period, std::span<const std::string> names);

/// The same in plain words. `names`: of the frames that were checked.
[[nodiscard]] std::string describe_periods(std::span<const RigPeriod> periods,
                                           std::span<const std::string> names);

/// The report of `rig check --frames` (docs/sequences.md): figures of the last period, and all
/// periods where there are more.
[[nodiscard]] nlohmann::ordered_json periods_json(std::span<const RigPeriod> periods,
                                                  std::span<const std::string> names);

}  // namespace pencilscan
