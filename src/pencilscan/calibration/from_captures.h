#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "pencilscan/calibration/calibration_report.h"
#include "pencilscan/calibration/tracks.h"

namespace pencilscan {

struct CapturesOptions {
  std::optional<KnownDistance> distance;
  std::string board;  ///< as board_from_text() reads it; empty: none
  std::size_t max_tracks = GrayTrackOptions{}.max_tracks;
  GivenTolerance tolerance{};  ///< of K that the devices file gives
  std::uint64_t seed = 1;
};

/// Everything that Gray-code captures say of a rig.
struct CapturesCalibration {
  CalibrationInput input;
  CalibrationResult result;  ///< its rig has the colours too
  Uncertainty uncertainty;
  Verdict verdict;
  std::vector<DecodeSummary> decoded;
  LoopClosure loop;
  ColorCalibration color;

  [[nodiscard]] bool is_usable() const { return verdict.grade != Grade::kUnusable; }
};

/// Decodes the captures, one folder per pose of the object, solves for the rig and judges it.
/// InputError for folders that do not fit the devices, and for one that is named twice.
[[nodiscard]] CapturesCalibration calibrate_captures(
    const UncalibratedRig& devices, const std::vector<std::filesystem::path>& captures,
    const CapturesOptions& options = {}, const Progress& progress = {});

/// calibration.json.
[[nodiscard]] nlohmann::ordered_json calibration_json(const CapturesCalibration& calibration);

/// What a reader wants to know at once: verdict and its reasons, residuals, error of a point.
[[nodiscard]] nlohmann::ordered_json calibration_figures(const CapturesCalibration& calibration);

}  // namespace pencilscan
