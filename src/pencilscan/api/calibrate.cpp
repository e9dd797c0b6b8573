#include "pencilscan/api/calibrate.h"

#include <nlohmann/json.hpp>

#include "pencilscan/api/run_stages.h"
#include "pencilscan/calibration/from_captures.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/io/json_text.h"
#include "pencilscan/rig/device_list.h"

namespace pencilscan {
namespace {

std::size_t device_named(const Rig& rig, const std::string& name) {
  for (std::size_t d = 0; d < device_count(rig); ++d)
    if (device_at(rig, d).name == name) return d;
  throw InputError("options", "known_distance", name, "must be the name of a device");
}

/// The default where nothing is stated. InputError beyond what the command takes.
double tolerance(const char* name, std::optional<double> stated, double most, double otherwise) {
  if (!stated) return otherwise;
  if (!(*stated >= 0 && *stated <= most))
    throw InputError("options", name, formatted(*stated, "%g"),
                     "must be between 0 and " + formatted(most, "%g"));
  return *stated;
}

}  // namespace

CalibratedRig calibrate_rig(const UncalibratedRig& devices,
                            const std::vector<std::filesystem::path>& captures,
                            const RigCalibrationOptions& options) {
  if (captures.empty()) throw InputError("captures", "", "", "must be at least one folder");
  CapturesOptions of_captures;
  if (const auto& known = options.known_distance) {
    of_captures.distance = KnownDistance{device_named(devices.rig, known->devices[0]),
                                         device_named(devices.rig, known->devices[1]), known->mm};
    if (!(known->mm > 0) || of_captures.distance->a == of_captures.distance->b) {
      throw InputError("options", "known_distance", std::to_string(known->mm),
                       "must be two different devices and a distance > 0 in mm");
    }
  }
  of_captures.board = options.board;
  if (options.max_tracks > 0) of_captures.max_tracks = options.max_tracks;
  const GivenTolerance usual;
  of_captures.tolerance = {tolerance("focal_tolerance", options.focal_tolerance,
                                     100 * usual.kMostFocal, 100 * usual.focal) /
                               100,
                           tolerance("center_tolerance", options.center_tolerance,
                                     usual.kMostCenterPx, usual.center_px)};
  of_captures.seed = options.seed;
  CalibratedRig result;
  constexpr std::array<std::string_view, 2> kStages = {"calibrating", "judging"};
  run_stages(options.progress, kStages, [&](const Progress& progress) {
    const CapturesCalibration found = calibrate_captures(devices, captures, of_captures, progress);
    result.rig = found.result.rig;
    result.verdict = to_string(found.verdict.grade);
    result.reasons = found.verdict.reasons();
    result.figures = json_text(calibration_figures(found));
    result.report = json_text(calibration_json(found));
  });
  return result;
}

}  // namespace pencilscan
