#include "pencilscan/calibration/from_captures.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "pencilscan/calibration/decode_captures.h"
#include "pencilscan/calibration/scale_deviation.h"
#include "pencilscan/planning/units.h"

namespace pencilscan {

CapturesCalibration calibrate_captures(const UncalibratedRig& devices,
                                       const std::vector<std::filesystem::path>& folders,
                                       const CapturesOptions& options, const Progress& progress) {
  const auto tell = [&](const char* stage, double done) {
    if (progress) progress(stage, done);
  };
  CapturesCalibration all;
  CalibrationInput& input = all.input;
  input.rig = devices.rig;
  input.known = devices.given;
  input.distance = options.distance;
  DecodedCaptures decoded =
      decode_captures(input.rig, folders, options.board, options.max_tracks, progress);
  all.decoded = std::move(decoded.pairs);
  all.color = std::move(decoded.color);
  input.tracks = std::move(decoded.tracks);
  input.board_views = std::move(decoded.board_views);
  input.projected_corners = std::move(decoded.projected_corners);
  if (!options.board.empty()) input.boards = folders.size();
  std::vector<Finding> findings = std::move(decoded.findings);

  CalibrateOptions calibrate_options;
  calibrate_options.tolerance = options.tolerance;
  all.result = calibrate(input, calibrate_options, progress);
  set_colors(all.color, all.result.rig);
  tell("judging", 0.9);
  all.uncertainty.devices.resize(device_count(input.rig));
  if (all.result.solved)
    all.uncertainty = uncertainty(all.result.problem, all.result.adjustment, options.seed);
  all.loop = close_loop(all.result);
  if (const auto finding = judge_loop(all.result, all.loop)) findings.push_back(*finding);
  if (auto warning = all.result.solved ? pose_unit_warning(all.result.rig) : std::nullopt)
    findings.push_back({Grade::kDoubtful, std::move(*warning), "give the known distance in mm"});
  all.verdict = judge(input, all.result, all.uncertainty, std::move(findings));
  tell("judging", 1);
  return all;
}

nlohmann::ordered_json calibration_json(const CapturesCalibration& calibration) {
  return calibration_json(CalibrationReport{
      calibration.input, calibration.result, calibration.uncertainty, calibration.verdict,
      calibration.decoded, calibration.loop, calibration.color});
}

nlohmann::ordered_json calibration_figures(const CapturesCalibration& calibration) {
  const CalibrationResult& result = calibration.result;
  const Verdict& verdict = calibration.verdict;
  nlohmann::ordered_json figures;
  figures["verdict"] = to_string(verdict.grade);
  if (verdict.grade != Grade::kGood) figures["reasons"] = verdict.reasons();
  figures["rms_px"] = result.rms_px;
  figures["held_out_rms_px"] = result.held_out_rms_px;
  if (!result.problem.board_views.empty()) figures["board_rms_px"] = result.board_rms_px;
  figures["views"] = result.views;
  figures["views_dropped"] = result.views_dropped;
  figures["point_sigma"] = calibration.uncertainty.volume_median;
  if (const auto scale = scale_deviation(calibration.input, result, calibration.uncertainty))
    figures["length_sigma_percent"] = 100 * scale->share;
  figures["unit"] = result.rig.unit_known ? "mm" : "unknown";
  return figures;
}

}  // namespace pencilscan
