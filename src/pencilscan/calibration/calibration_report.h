#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "pencilscan/calibration/loop_closure.h"
#include "pencilscan/calibration/verdict.h"
#include "pencilscan/color/color_calibration.h"

namespace pencilscan {

/// How one pair's images decoded.
struct DecodeSummary {
  std::size_t capture = 0;
  std::size_t projector = 0;  ///< index in the rig
  std::size_t camera = 0;     ///< index in the rig
  std::array<std::size_t, kPixelStates> counts{};
  double valid_share = 0;   ///< of lit pixels
  std::size_t samples = 0;  ///< sub-pixel correspondences
  std::string wrong_order;  ///< empty: none noticed
};

struct CalibrationReport {
  const CalibrationInput& input;
  const CalibrationResult& result;
  const Uncertainty& uncertainty;
  const Verdict& verdict;
  const std::vector<DecodeSummary>& decoded;
  const LoopClosure& loop;
  const ColorCalibration& color;
};

/// Everything of the report as numbers.
[[nodiscard]] nlohmann::ordered_json calibration_json(const CalibrationReport& report);

}  // namespace pencilscan
