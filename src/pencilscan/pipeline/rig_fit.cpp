#include "pencilscan/pipeline/rig_fit.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "pencilscan/core/formatted.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/pipeline/disagreement_warnings.h"
#include "pencilscan/pipeline/frame.h"
#include "pencilscan/pipeline/lost_cameras.h"

namespace pencilscan {
namespace {

using nlohmann::ordered_json;

RigVerdict verdict_of(const RigFit& fit, std::size_t moved) {
  if (!are_enough(fit.before)) return RigVerdict::kUnknown;
  if (!fit.doubt.empty() || disagrees(fit.after)) return RigVerdict::kUnexplained;
  const bool all_told = std::all_of(fit.devices.begin(), fit.devices.end(),
                                    [](const DeviceFit& device) { return device.is_told; });
  if (moved == 0 && !all_told) return RigVerdict::kUnknown;
  return moved == 0   ? RigVerdict::kFits
         : moved == 1 ? RigVerdict::kOneMoved
                      : RigVerdict::kSeveralMoved;
}

std::string unseen_text(const RigFit& fit) {
  std::string unseen;
  for (const DeviceFit& device : fit.devices) {
    if (!device.may_have_moved_unseen) continue;
    add_name(unseen,
             full_name(device) + (std::isfinite(device.seen_from_px)
                                      ? formatted(device.seen_from_px, " by less than %.0f px")
                                      : ""));
  }
  return unseen.empty() ? "" : "; crossings of lines would hardly show a move of " + unseen;
}

std::string verdict_text(const RigFit& fit) {
  std::string moved;
  for (const DeviceFit& device : fit.devices) {
    if (device.has_moved)
      add_name(moved, full_name(device) + formatted(device.shift_px, " by %.2f px"));
  }
  const std::string misses =
      "crossing lines miss each other by " + formatted(fit.before.median_px, "%.3f px (median), ") +
      "where image noise explains " + formatted(fit.before.expected_px, "%.3f");
  switch (fit.verdict) {
    case RigVerdict::kFits:
      return "the rig fits: " + misses + unseen_text(fit);
    case RigVerdict::kOneMoved:
      return "one device is to be put back: " + moved +
             "; then crossing lines miss each other by " +
             formatted(fit.after.median_px, "%.3f px");
    case RigVerdict::kSeveralMoved:
      return "several devices moved: " + moved + "; then crossing lines miss each other by " +
             formatted(fit.after.median_px, "%.3f px") +
             ": reconstruct --refine-rig, or calibrate anew";
    case RigVerdict::kUnexplained:
      if (!fit.doubt.empty()) {
        return fit.doubt +
               ": what has no name, or a wrong one, stands farther from where the rig has it than "
               "crossings can tell, its picture is another's, or a dark pattern on the object cuts "
               "its lines into pieces; " +
               misses;
      }
      return misses +
             ", and putting devices back does not help: lens parameters, or an object "
             "that moved while the shutters were open";
    case RigVerdict::kUnknown:
      if (are_enough(fit.before)) {
        std::string untold;
        for (const DeviceFit& device : fit.devices) {
          if (!device.is_told)
            add_name(untold,
                     full_name(device) + " (" + std::to_string(device.crossings.crossings) + ")");
        }
        return "too few labelled lines, and crossings of them, to judge " + untold + "; of all, " +
               misses;
      }
      return "only " + std::to_string(fit.before.crossings) +
             " crossings of labelled lines: too few to tell";
  }
  return {};
}

ordered_json disagreement_json(const CrossingDisagreement& d) {
  return {{"crossings", d.crossings},
          {"median_px", thousandth(d.median_px)},
          {"expected_px", thousandth(d.expected_px)}};
}

}  // namespace

double thousandth(double value) { return std::isfinite(value) ? std::round(1e3 * value) / 1e3 : 0; }

const char* to_string(RigVerdict verdict) {
  switch (verdict) {
    case RigVerdict::kFits:
      return "fits";
    case RigVerdict::kOneMoved:
      return "one moved";
    case RigVerdict::kSeveralMoved:
      return "several moved";
    case RigVerdict::kUnexplained:
      return "unexplained";
    case RigVerdict::kUnknown:
      return "unknown";
  }
  return "";
}

std::string full_name(const DeviceFit& device) {
  return (device.is_projector ? "projector " : "camera ") + device.name;
}

RigFit fit_of(const Rig& stated, const Rig& rig, const Explanation& explained) {
  const double unit = footprint(stated);
  const NamedCrossings& named = explained.named;
  const MovedDevices& found = explained.found;

  RigFit fit;
  fit.frames = explained.labelings.size();
  fit.labelled_share = named.labelled_share;
  fit.before = crossing_disagreement(rig, named.tracks);
  fit.after = crossing_disagreement(explained.put_back, named.tracks);
  fit.doubt = named.doubt.text();
  if (const auto d = device_that_is_off(explained.left); d && fit.doubt.empty()) {
    fit.doubt = misses_text(device_at(rig, *d), explained.left[*d]) +
                ", and putting devices back does not help";
  }
  if (fit.doubt.empty() && !explained.contradicted.empty())
    fit.doubt = contradiction_text(explained.contradicted);
  if (fit.doubt.empty()) fit.doubt = explained.misplaced;
  const auto per_device = device_disagreements(rig, named.tracks);
  const Sphere volume = working_volume(rig);
  for (std::size_t d = 0; d < device_count(rig); ++d) {
    fit.devices.push_back({device_at(rig, d).name, d >= rig.cameras.size(), per_device[d],
                           found.alone[d].shift_px, found.alone[d].sigma_px, false,
                           are_enough(per_device[d]) || named.doubt.telling(d).are_enough(), 0, 0,
                           found.alone[d].seen_from_px});
    const Device& device = device_at(rig, d);
    const double spacing_px =
        line_spacing(rig) * device.focal_px() / (device.center() - volume.center).norm();
    fit.devices.back().may_have_moved_unseen = found.alone[d].seen_from_px > spacing_px / 2;
  }
  fit.put_back = stated;
  for (const DeviceMove& move : found.moved) {
    DeviceFit& device = fit.devices[move.device];
    device.has_moved = true;
    device.shift_px = move.shift_px;
    device.sigma_px = move.sigma_px;
    device.rotation_px = move.correction.rotation_px.norm();
    device.translation_mm = unit * move.correction.translation_mm.norm();
    PoseCorrection in_mm = move.correction;
    in_mm.translation_mm *= unit;
    Device& changed = device_at(fit.put_back, move.device);
    changed.device_from_world = corrected_pose(changed, in_mm);
  }
  fit.verdict = verdict_of(fit, found.moved.size());
  fit.text = verdict_text(fit);
  return fit;
}

ordered_json rig_fit_json(const RigFit& fit) {
  ordered_json report;
  report["verdict"] = to_string(fit.verdict);
  report["text"] = fit.text;
  report["frames"] = fit.frames;
  report["labelled_share"] = thousandth(fit.labelled_share);
  report["before"] = disagreement_json(fit.before);
  report["after"] = disagreement_json(fit.after);
  report["moved"] = ordered_json::array();
  report["devices"] = ordered_json::array();
  for (const DeviceFit& device : fit.devices) {
    if (device.has_moved) report["moved"].push_back(device.name);
    ordered_json entry = {{"name", device.name},
                          {"kind", device.is_projector ? "projector" : "camera"},
                          {"crossings", device.crossings.crossings},
                          {"median_px", thousandth(device.crossings.median_px)},
                          {"expected_px", thousandth(device.crossings.expected_px)},
                          {"off_by_px", thousandth(device.shift_px)},
                          {"off_by_sigma_px", thousandth(device.sigma_px)},
                          {"seen_from_px", std::isfinite(device.seen_from_px)
                                               ? ordered_json(thousandth(device.seen_from_px))
                                               : ordered_json()},
                          {"moved", device.has_moved}};
    if (device.has_moved) {
      entry["rotation_px"] = thousandth(device.rotation_px);
      entry["translation_mm"] = thousandth(device.translation_mm);
    }
    report["devices"].push_back(entry);
  }
  return report;
}

}  // namespace pencilscan
