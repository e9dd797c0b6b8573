#include "pencilscan/exchange/exchanged_device.h"

#include <algorithm>
#include <cstdio>

#include "pencilscan/core/error.h"
#include "pencilscan/rig/device_list.h"

namespace pencilscan {
namespace {

ExchangedDevice* find_device(std::vector<ExchangedDevice>& devices, const std::string& name) {
  const auto at = std::find_if(devices.begin(), devices.end(),
                               [&](const ExchangedDevice& d) { return d.device.name == name; });
  return at == devices.end() ? nullptr : &*at;
}

/// Several descriptions of one device become one.
std::vector<ExchangedDevice> merged(std::vector<ExchangedDevice> described) {
  std::vector<ExchangedDevice> devices;
  for (ExchangedDevice& next : described) {
    ExchangedDevice* known = find_device(devices, next.device.name);
    if (known == nullptr) {
      devices.push_back(std::move(next));
      continue;
    }
    if (known->device.width == 0) {
      known->device.width = next.device.width;
      known->device.height = next.device.height;
    }
    // A lens belongs to its K.
    if (!known->given.K && next.given.K) {
      known->device.K = next.device.K;
      known->device.distortion = next.device.distortion;
      known->given.K = true;
      known->given.distortion = next.given.distortion;
      known->lens = next.lens;
    }
    if (!known->given.pose && next.given.pose) {
      known->device.device_from_world = next.device.device_from_world;
      known->given.pose = true;
    }
    known->is_projector = known->is_projector || next.is_projector;
  }
  return devices;
}

/// Devices of pairs whose pose only the base knows.
void adopt_poses(const UncalibratedRig& base, double mm_per_unit,
                 std::vector<ExchangedDevice>& devices) {
  for (std::size_t d = 0; d < device_count(base.rig); ++d) {
    const Device& from = device_at(base.rig, d);
    ExchangedDevice* known = find_device(devices, from.name);
    if (known == nullptr || known->given.pose || !base.given[d].pose) continue;
    known->device.device_from_world = from.device_from_world;
    known->device.device_from_world.translation /= mm_per_unit;
    known->given.pose = true;
  }
}

/// Poses follow from each other along the pairs.
void place(const std::vector<RelativePose>& relative, std::vector<ExchangedDevice>& devices) {
  if (relative.empty()) return;
  const bool is_any_placed = std::any_of(devices.begin(), devices.end(),
                                         [](const ExchangedDevice& d) { return d.given.pose; });
  if (!is_any_placed) find_device(devices, relative.front().first)->given.pose = true;
  for (bool is_growing = true; is_growing;) {
    is_growing = false;
    for (const RelativePose& pair : relative) {
      ExchangedDevice* first = find_device(devices, pair.first);
      ExchangedDevice* second = find_device(devices, pair.second);
      if (first->given.pose == second->given.pose) continue;
      const RigidTransform& step = pair.second_from_first;
      if (first->given.pose)
        second->device.device_from_world = step * first->device.device_from_world;
      else
        first->device.device_from_world = step.inverse() * second->device.device_from_world;
      first->given.pose = second->given.pose = true;
      is_growing = true;
    }
  }
}

void adopt_lens(const ExchangeOptions& options, ExchangedDevice& d) {
  if (!d.lens) return;
  const BrownFit fit = fit_brown(d.device, d.lens);
  if (!(fit.worst_px <= options.worst_lens_px)) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), "%.3g px", fit.worst_px);
    throw InputError(d.source, "distortion of " + d.device.name, text.data(),
                     "k1 k2 p1 p2 k3 must reproduce its lens to " +
                         std::to_string(options.worst_lens_px).substr(0, 4) + " px");
  }
  d.device.distortion = fit.distortion;
  d.given.distortion = true;
}

/// Calibration only: a name, patterns and colours stay.
void take_over(const ExchangedDevice& from, const ExchangeOptions& options, Device& device,
               GivenCalibration& given) {
  if (from.given.K) {
    device.K = from.device.K;
    device.distortion = from.device.distortion;
    given.distortion = from.given.distortion;
    given.K = true;
  }
  if (from.given.pose) {
    device.device_from_world = from.device.device_from_world;
    device.device_from_world.translation *= options.mm_per_unit;
    given.pose = true;
  }
}

}  // namespace

UncalibratedRig join_rig(ExchangedRig files, const UncalibratedRig& base,
                         const ExchangeOptions& options) {
  std::vector<ExchangedDevice> devices = merged(std::move(files.devices));
  const bool is_any_placed =
      !files.relative.empty() || std::any_of(devices.begin(), devices.end(),
                                             [](const ExchangedDevice& d) { return d.given.pose; });
  adopt_poses(base, options.mm_per_unit, devices);
  place(files.relative, devices);
  UncalibratedRig result = base;
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
                       std::to_string(d.device.width) + " x " + std::to_string(d.device.height),
                       "must be that of --base, " + std::to_string(at->width) + " x " +
                           std::to_string(at->height));
    adopt_lens(options, d);
    take_over(d, options, *at, given[static_cast<std::size_t>(at - list.begin())]);
  };
  for (ExchangedDevice& d : devices) {
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
  if (is_any_placed) result.rig.unit_known = options.unit_known;
  return result;
}

void scale_rig(const std::string& first, const std::string& second, double mm,
               UncalibratedRig& rig) {
  const auto center_of_device = [&](const std::string& name) {
    for (std::size_t d = 0; d < device_count(rig.rig); ++d)
      if (device_at(rig.rig, d).name == name && rig.given[d].pose)
        return device_at(rig.rig, d).center();
    throw InputError("command line", "--known-distance", name, "must be a device with a pose");
  };
  const double now = (center_of_device(first) - center_of_device(second)).norm();
  if (!(now > 0))
    throw InputError("command line", "--known-distance", second, "must not stand at " + first);
  rig.rig = scaled(std::move(rig.rig), mm / now);
  rig.rig.unit_known = true;
}

}  // namespace pencilscan
