#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "pencilscan/calibration/color_calibration.h"
#include "pencilscan/calibration/loop_closure.h"
#include "pencilscan/calibration/verdict.h"

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

/// visit(view, error) for up to `most` views of a device, evenly chosen.
template <class Visit>
void for_some_residuals(const CalibrationReport& report, std::size_t device, std::size_t most,
                        Visit visit) {
  const std::size_t step = report.result.residuals[device].views / most + 1;
  std::size_t seen = 0;
  for_each_residual(report.result.problem,
                    [&](std::size_t, const TrackView& view, const Vec2& error) {
                      if (view.device == device && seen++ % step == 0) visit(view, error);
                    });
}

/// Everything of the report as numbers.
[[nodiscard]] nlohmann::ordered_json calibration_json(const CalibrationReport& report);
/// The same for people: one HTML page without scripts or other files, its plots SVG.
[[nodiscard]] std::string calibration_html(const CalibrationReport& report);

}  // namespace pencilscan
