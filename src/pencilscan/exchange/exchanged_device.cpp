#include "pencilscan/exchange/exchanged_device.h"

#include <algorithm>

#include "pencilscan/core/error.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/exchange/base_world.h"
#include "pencilscan/exchange/merged_files.h"

namespace pencilscan {
namespace {

void adopt_lens(const ExchangeOptions& options, ExchangedDevice& d) {
  if (!d.lens) return;
  const BrownFit fit = fit_brown(d.device, d.lens);
  if (!(fit.worst_px <= options.worst_lens_px)) {
    throw InputError(
        d.source, "distortion of " + d.device.name, formatted(fit.worst_px, "%.3g px"),
        "k1 k2 p1 p2 k3 must reproduce its lens to " + formatted(options.worst_lens_px) + " px");
  }
  d.device.distortion = fit.distortion;
  d.given.distortion = true;
}

/// Calibration only: a name, patterns and colours stay.
void take_over(const ExchangedDevice& from, Device& device, GivenCalibration& given) {
  if (from.given.K) {
    device.K = from.device.K;
    device.distortion = from.device.distortion;
    given.distortion = from.given.distortion;
    given.K = true;
  }
  if (from.given.pose) {
    device.device_from_world = from.device.device_from_world;
    given.pose = true;
  }
}

/// What files contradict each other in, after their lengths have a unit.
void tell_conflicts(const MergedFiles& merged, const BasePlacement& placement,
                    std::vector<std::string>& warnings) {
  const std::string unit = placement.unit_known ? "mm" : "units";
  for (PoseConflict conflict : merged.conflicts) {
    conflict.difference.shift *= placement.mm_per_unit;
    warnings.push_back(
        conflict.source + " has " + conflict.device + ", seen from " + conflict.seen_from + ", " +
        difference_text(conflict.difference, unit) + " from where " + conflict.used +
        (conflict.used == "the other files" ? " have" : " has") + " it, which is used");
  }
}

}  // namespace

void state_size(const std::string& name, int width, int height, ExchangedRig& rig) {
  const std::string text = name + "=" + std::to_string(width) + "x" + std::to_string(height);
  bool is_there = false;
  for (const ExchangedDevice& d : rig.devices) {
    if (d.device.name != name) continue;
    is_there = true;
    if (d.device.width > 0 && (d.device.width != width || d.device.height != height))
      throw InputError("command line", "--size", text,
                       "must be that of " + d.source + ", " + std::to_string(d.device.width) + "x" +
                           std::to_string(d.device.height));
  }
  if (!is_there)
    throw InputError("command line", "--size", text, "there is no device of this name");
  for (ExchangedDevice& d : rig.devices) {
    if (d.device.name != name) continue;
    d.device.width = width;
    d.device.height = height;
  }
}

JoinedRig join_rig(ExchangedRig files, const UncalibratedRig& base,
                   const ExchangeOptions& options) {
  const bool world_is_arbitrary = files.world_is_arbitrary;
  MergedFiles merged = merge_files(std::move(files), options);
  JoinedRig result;
  static_cast<UncalibratedRig&>(result) = base;
  BasePlacement placement = lay_into_base(world_is_arbitrary, options, merged, result);
  result.notes = std::move(placement.notes);
  result.warnings = std::move(merged.warnings);
  tell_conflicts(merged, placement, result.warnings);
  result.warnings.insert(result.warnings.end(), placement.warnings.begin(),
                         placement.warnings.end());
  const auto cameras_of_base = static_cast<std::ptrdiff_t>(base.rig.cameras.size());
  std::vector<GivenCalibration> cameras(base.given.begin(), base.given.begin() + cameras_of_base);
  std::vector<GivenCalibration> projectors(base.given.begin() + cameras_of_base, base.given.end());
  const auto into = [&](ExchangedDevice& d, auto& list, std::vector<GivenCalibration>& given) {
    auto at = std::find_if(list.begin(), list.end(),
                           [&](const Device& old) { return old.name == d.device.name; });
    if (at == list.end()) {
      list.emplace_back().name = d.device.name;
      given.emplace_back();
      at = list.end() - 1;
      at->width = d.device.width;
      at->height = d.device.height;
    }
    if (d.device.width == 0) {
      d.device.width = at->width;
      d.device.height = at->height;
    }
    if (d.device.width <= 0 || d.device.height <= 0)
      throw InputError(
          d.source, "image size of " + d.device.name, "missing",
          "must be in the file, in --base, or given as --size " + d.device.name + "=1280x960");
    if (d.device.width != at->width || d.device.height != at->height)
      throw InputError(d.source, "image size of " + d.device.name,
                       size_text(d.device.width, d.device.height),
                       "must be that of --base, " + size_text(at->width, at->height));
    adopt_lens(options, d);
    take_over(d, *at, given[static_cast<std::size_t>(at - list.begin())]);
  };
  for (ExchangedDevice& d : merged.devices) {
    const auto& old = base.rig.projectors;
    const bool is_old_projector = std::any_of(
        old.begin(), old.end(), [&](const Projector& p) { return p.name == d.device.name; });
    if (d.is_projector || is_old_projector)
      into(d, result.rig.projectors, projectors);
    else
      into(d, result.rig.cameras, cameras);
  }
  result.given = cameras;
  result.given.insert(result.given.end(), projectors.begin(), projectors.end());
  if (placement.is_any_placed) result.rig.unit_known = placement.unit_known;
  return result;
}

}  // namespace pencilscan
