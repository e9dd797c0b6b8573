#pragma once

#include <optional>
#include <vector>

#include "pencilscan/calibration/calibrate.h"
#include "pencilscan/calibration/finding.h"

namespace pencilscan {

/// Once round the ring of devices and back, every step by nothing but what its own two devices see
/// of each other. The adjustment spreads contradictions over the whole rig until no single error
/// looks large; here they add up.
struct LoopClosure {
  std::vector<std::size_t> devices;  ///< in order, the last joins the first; empty: no closed ring
  double rotation_rad = 0;           ///< by which the first device comes back turned
  double scale = 1;                  ///< by which lengths come back multiplied
  double gap = 0;                    ///< of points of the volume, root mean square, rig units
  double gap_px = 0;                 ///< the same in the first device's image
};

struct LoopClosureOptions {
  std::size_t least_matches = 60;  ///< of two devices that follow each other
  std::size_t least_links = 20;  ///< points seen by three that follow each other: they carry scale
  double widest_step_rad = 2.1;  ///< about the middle; a wider gap is no ring
};

/// Pairs are adjusted on their own with the inner parameters of the result. Scale passes from step
/// to step by the depth of points that both see.
[[nodiscard]] LoopClosure close_loop(const CalibrationResult& result,
                                     const LoopClosureOptions& options = {});

/// A loop that does not close, in plain words; nothing where it does.
[[nodiscard]] std::optional<Finding> judge_loop(const CalibrationResult& result,
                                                const LoopClosure& loop, double most_px = 1.5);

}  // namespace pencilscan
