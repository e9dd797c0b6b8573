#include "pencilscan/exchange/merged_files.h"

#include <algorithm>
#include <numbers>
#include <optional>

#include "pencilscan/core/error.h"
#include "pencilscan/core/formatted.h"

namespace pencilscan {
namespace {

/// Files hold numbers in some fifteen digits, or as few as people typed.
constexpr double kRounding = 1e-6;

/// A device with the files that its values come from.
struct Described {
  ExchangedDevice device;
  std::string size_source, lens_source, pose_source;
  bool is_lens_told = false;

  explicit Described(ExchangedDevice first)
      : device(std::move(first)),
        size_source(device.source),
        lens_source(device.source),
        pose_source(device.source) {}
};

std::string K_text(const Mat3& K) {
  return "fx fy cx cy = " + formatted(K(0, 0), "%.7g") + " " + formatted(K(1, 1), "%.7g") + " " +
         formatted(K(0, 2), "%.7g") + " " + formatted(K(1, 2), "%.7g");
}

std::string distortion_text(const ExchangedDevice& d) {
  if (!d.given.distortion) return "none stated";
  std::string text;
  for (const double k : d.device.distortion.stated())
    text += (text.empty() ? "[" : ", ") + formatted(k, "%.5g");
  return text + (d.lens ? "] of another model" : "]");
}

bool is_same_K(const Mat3& a, const Mat3& b) { return (a - b).norm() <= kRounding * a(0, 0); }

bool is_same_distortion(const ExchangedDevice& a, const ExchangedDevice& b) {
  bool is_same = static_cast<bool>(a.lens) == static_cast<bool>(b.lens);
  for (std::size_t i = 0; i < Distortion::kCoefficients; ++i)
    is_same = is_same && std::abs(a.device.distortion[i] - b.device.distortion[i]) <= kRounding;
  return is_same;
}

void join_size(const ExchangedDevice& next, Described& known) {
  Device& device = known.device.device;
  if (next.device.width == 0) return;
  if (device.width == 0) {
    device.width = next.device.width;
    device.height = next.device.height;
    known.size_source = next.source;
  } else if (device.width != next.device.width || device.height != next.device.height) {
    throw InputError(
        next.source, "image size of " + device.name,
        size_text(next.device.width, next.device.height),
        "must be that of " + known.size_source + ", " + size_text(device.width, device.height));
  }
}

/// A lens belongs to its K.
void join_lens(const ExchangedDevice& next, Described& known, std::vector<std::string>& warnings) {
  ExchangedDevice& d = known.device;
  if (!next.given.K) return;
  const bool is_same = d.given.K && is_same_K(d.device.K, next.device.K);
  if (!d.given.K || (is_same && !d.given.distortion && next.given.distortion)) {
    d.device.K = next.device.K;
    d.device.distortion = next.device.distortion;
    d.given.K = true;
    d.given.distortion = next.given.distortion;
    d.lens = next.lens;
    known.lens_source = next.source;
    return;
  }
  const bool is_same_lens = !next.given.distortion || is_same_distortion(d, next);
  if (known.is_lens_told || (is_same && is_same_lens)) return;
  known.is_lens_told = true;
  std::string text = d.device.name + " differs: ";
  if (!is_same)
    text += K_text(d.device.K) + " in " + known.lens_source + ", which is used, " +
            K_text(next.device.K) + " in " + next.source;
  if (!is_same_lens)
    text += (is_same ? "" : "; ") + ("distortion " + distortion_text(d)) + " in " +
            known.lens_source + ", which is used, " + distortion_text(next) + " in " + next.source;
  warnings.push_back(text);
}

bool is_conflict(const PoseDifference& off, double distance, const ExchangeOptions& options) {
  return off.turn_deg > options.most_turn_deg || off.shift > options.most_shift_share * distance;
}

void join_pose(const ExchangedDevice& next, const ExchangeOptions& options, Described& known,
               std::vector<PoseConflict>& conflicts) {
  ExchangedDevice& d = known.device;
  if (!next.given.pose) return;
  if (!d.given.pose) {
    d.device.device_from_world = next.device.device_from_world;
    d.given.pose = true;
    known.pose_source = next.source;
    return;
  }
  const PoseDifference off = difference(d.device.device_from_world, next.device.device_from_world);
  if (is_conflict(off, d.device.device_from_world.translation.norm(), options))
    conflicts.push_back({d.device.name, "the world", next.source, known.pose_source, off});
}

std::size_t index_of(const std::vector<ExchangedDevice>& devices, const std::string& name) {
  return static_cast<std::size_t>(
      std::find_if(devices.begin(), devices.end(),
                   [&](const ExchangedDevice& d) { return d.device.name == name; }) -
      devices.begin());
}

/// Poses follow from each other along the pairs, until no more does.
void grow(const std::vector<RelativePose>& relative, std::vector<ExchangedDevice>& devices,
          PoseGroup& group) {
  for (bool is_growing = true; is_growing;) {
    is_growing = false;
    for (const RelativePose& pair : relative) {
      const std::size_t first = index_of(devices, pair.first);
      const std::size_t second = index_of(devices, pair.second);
      ExchangedDevice& a = devices[first];
      ExchangedDevice& b = devices[second];
      if (a.given.pose == b.given.pose) continue;
      if (a.given.pose)
        b.device.device_from_world = pair.second_from_first * a.device.device_from_world;
      else
        a.device.device_from_world = pair.second_from_first.inverse() * b.device.device_from_world;
      group.devices.push_back(a.given.pose ? second : first);
      a.given.pose = b.given.pose = true;
      is_growing = true;
    }
  }
}

void place(const std::vector<RelativePose>& relative, MergedFiles& merged) {
  PoseGroup stated{{}, true};
  for (std::size_t i = 0; i < merged.devices.size(); ++i)
    if (merged.devices[i].given.pose) stated.devices.push_back(i);
  grow(relative, merged.devices, stated);
  if (!stated.devices.empty()) merged.groups.push_back(std::move(stated));
  for (const RelativePose& pair : relative) {
    const std::size_t first = index_of(merged.devices, pair.first);
    if (merged.devices[first].given.pose) continue;
    merged.devices[first].given.pose = true;
    PoseGroup group{{first}, false};
    grow(relative, merged.devices, group);
    merged.groups.push_back(std::move(group));
  }
}

/// Pairs that do not close round a rig.
void find_open_rings(const std::vector<RelativePose>& relative, const ExchangeOptions& options,
                     MergedFiles& merged) {
  for (const RelativePose& pair : relative) {
    const ExchangedDevice& a = *device_named(merged.devices, pair.first);
    const ExchangedDevice& b = *device_named(merged.devices, pair.second);
    const RigidTransform placed = b.device.device_from_world * a.device.device_from_world.inverse();
    const PoseDifference off = difference(placed, pair.second_from_first);
    if (is_conflict(off, pair.second_from_first.translation.norm(), options))
      merged.conflicts.push_back({pair.second, pair.first, pair.source, "the other files", off});
  }
}

}  // namespace

const ExchangedDevice* device_named(const std::vector<ExchangedDevice>& devices,
                                    const std::string& name) {
  const std::size_t at = index_of(devices, name);
  return at == devices.size() ? nullptr : &devices[at];
}

PoseDifference difference(const RigidTransform& a, const RigidTransform& b) {
  const Eigen::AngleAxisd turn(Mat3(a.rotation.transpose() * b.rotation));
  return {std::abs(turn.angle()) * 180 / std::numbers::pi,
          (a.inverse().translation - b.inverse().translation).norm()};
}

std::string difference_text(const PoseDifference& difference, const std::string& unit) {
  constexpr double kNothing = 1e-9;  // what computing leaves
  const auto text = [](double value) {
    return value < kNothing ? std::string("0") : formatted(value, "%.3g");
  };
  return text(difference.shift) + " " + unit + " and " + text(difference.turn_deg) + " degrees";
}

MergedFiles merge_files(ExchangedRig files, const ExchangeOptions& options) {
  MergedFiles merged;
  std::vector<Described> described;
  for (ExchangedDevice& next : files.devices) {
    const auto known = std::find_if(described.begin(), described.end(), [&](const Described& d) {
      return d.device.device.name == next.device.name;
    });
    if (known == described.end()) {
      described.emplace_back(std::move(next));
      continue;
    }
    join_size(next, *known);
    join_lens(next, *known, merged.warnings);
    join_pose(next, options, *known, merged.conflicts);
    known->device.is_projector = known->device.is_projector || next.is_projector;
  }
  for (Described& d : described) merged.devices.push_back(std::move(d.device));
  place(files.relative, merged);
  find_open_rings(files.relative, options, merged);
  return merged;
}

}  // namespace pencilscan
