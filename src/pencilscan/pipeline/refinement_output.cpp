#include "pencilscan/pipeline/refinement_output.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

namespace pencilscan {
namespace {

using nlohmann::ordered_json;

/// Rounded to micrometres and thousandths of a pixel, so that the file stays readable.
double rounded(double value) { return std::isfinite(value) ? std::round(1e3 * value) / 1e3 : 0; }

ordered_json disagreement(const CrossingDisagreement& d) {
  return {{"crossings", d.crossings},
          {"median_px", rounded(d.median_px)},
          {"expected_px", rounded(d.expected_px)}};
}

std::vector<std::string> warnings_of(const RigRefinement& refinement) {
  // Both sigmas are 1 px; farther is no usual calibration error.
  constexpr double kUsualPx = 4;
  std::vector<std::string> warnings;
  if (!refinement.report.refined) return warnings;
  for (const DeviceRefinement& device : refinement.report.devices) {
    if (!device.refined) {
      warnings.push_back(device.name + " keeps its pose: only " + std::to_string(device.tracks) +
                         " crossings tell of it");
    } else if (std::hypot(device.rotation_px, device.translation_px) > kUsualPx) {
      warnings.push_back(device.name +
                         " moved farther than calibration errors usually are: check "
                         "that it is what the rig says");
    }
  }
  if (disagrees(refinement.report.after)) {
    // Assigned, not pushed from a literal: g++ 12 sees a false overflow in that.
    std::string& warning = warnings.emplace_back();
    warning.append("after refinement, crossing lines still miss each other by more than image ")
        .append("noise explains: lens parameters may be off, or the object moved");
  }
  return warnings;
}

}  // namespace

ordered_json refinement_report(const RigRefinement& refinement,
                               const std::vector<std::string>& frames) {
  const RefineRigReport& r = refinement.report;
  ordered_json report;
  report["refined"] = r.refined;
  if (!r.refined) report["reason"] = r.reason;
  report["frames"] = frames;
  report["points"] = r.tracks;
  report["sightings"] = r.sightings;
  report["before"] = disagreement(r.before);
  report["after"] = disagreement(r.after);
  report["line_error_expected_px"] = rounded(r.expected_error_px);
  report["line_error_remaining_px"] = rounded(r.remaining_error_px);
  report["residual_scale"] = rounded(r.residual_scale);
  report["devices"] = ordered_json::array();
  for (const DeviceRefinement& d : r.devices) {
    report["devices"].push_back({{"name", d.name},
                                 {"crossings", d.tracks},
                                 {"refined", d.refined},
                                 {"rotation_px", rounded(d.rotation_px)},
                                 {"translation_mm", rounded(d.translation_mm)},
                                 {"translation_px", rounded(d.translation_px)}});
  }
  report["rounds"] = ordered_json::array();
  for (const RefinementRound& round : refinement.rounds) {
    report["rounds"].push_back({{"tolerance_px", rounded(round.tolerance_px)},
                                {"points", round.tracks},
                                {"before", disagreement(round.before)},
                                {"after", disagreement(round.after)}});
  }
  report["warnings"] = warnings_of(refinement);
  return report;
}

RefinementOutcome refinement_outcome(const Rig& rig, const ordered_json& report) {
  RefinementOutcome outcome;
  outcome.refined = report.at("refined").get<bool>();
  if (!outcome.refined) outcome.reason = report.at("reason").get<std::string>();
  outcome.before_px = report.at("before").at("median_px").get<double>();
  outcome.after_px = report.at("after").at("median_px").get<double>();
  outcome.warnings = report.at("warnings").get<std::vector<std::string>>();
  for (const auto& device : report.at("devices")) {
    if (!device.at("refined").get<bool>()) continue;
    std::array<char, 200> text{};
    std::snprintf(text.data(), text.size(), "%s moved by %.2f px of rotation and %.3f %s",
                  device.at("name").get<std::string>().c_str(),
                  device.at("rotation_px").get<double>(), device.at("translation_mm").get<double>(),
                  unit_name(rig).c_str());
    outcome.moves.emplace_back(text.data());
  }
  return outcome;
}

}  // namespace pencilscan
