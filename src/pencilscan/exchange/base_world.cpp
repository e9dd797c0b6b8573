#include "pencilscan/exchange/base_world.h"

#include <algorithm>
#include <optional>

#include "pencilscan/core/error.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/length_units.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/geometry/least_squares.h"
#include "pencilscan/rig/device_list.h"

namespace pencilscan {
namespace {

/// A device that files and base place.
struct Common {
  std::size_t device = 0;  ///< of the files
  RigidTransform in_base;
};

std::vector<Common> common_devices(const PoseGroup& group, const MergedFiles& files,
                                   const UncalibratedRig& base) {
  std::vector<Common> common;
  for (const std::size_t i : group.devices)
    for (std::size_t d = 0; d < device_count(base.rig); ++d)
      if (base.given[d].pose && device_at(base.rig, d).name == files.devices[i].device.name)
        common.push_back({i, device_at(base.rig, d).device_from_world});
  return common;
}

/// Placed devices of the base that the files do not place.
std::vector<std::string> kept_devices(const MergedFiles& files, const UncalibratedRig& base) {
  std::vector<std::string> kept;
  for (std::size_t d = 0; d < device_count(base.rig); ++d) {
    const std::string& name = device_at(base.rig, d).name;
    const ExchangedDevice* of_files = device_named(files.devices, name);
    if (base.given[d].pose && (of_files == nullptr || !of_files->given.pose)) kept.push_back(name);
  }
  return kept;
}

/// "cam0, cam1, volume", or "cam0, cam1, cam2, cam3 and 5 more".
std::string list_text(const std::vector<std::string>& words) {
  constexpr std::size_t kMost = 6;
  constexpr std::size_t kOfMany = 4;
  return name_list(words, words.size() > kMost ? kOfMany : kMost);
}

/// Length in the base over length in the files, of the distances of devices that both place;
/// nothing where there are no two.
std::optional<double> base_per_file(const std::vector<std::vector<Common>>& common,
                                    const MergedFiles& files) {
  std::vector<double> ratios;
  for (const std::vector<Common>& group : common) {
    for (std::size_t a = 0; a < group.size(); ++a) {
      for (std::size_t b = 0; b < a; ++b) {
        const double in_base =
            (group[a].in_base.inverse().translation - group[b].in_base.inverse().translation)
                .norm();
        const double in_files = (files.devices[group[a].device].device.center() -
                                 files.devices[group[b].device].device.center())
                                    .norm();
        if (in_base > 0 && in_files > 0) ratios.push_back(in_base / in_files);
      }
    }
  }
  if (ratios.empty()) return std::nullopt;
  return upper_median(std::move(ratios));
}

double scale_by_distance(const StatedDistance& known, const MergedFiles& files) {
  const auto fail = [](const std::string& name, const std::string& rule) {
    throw InputError("command line", "--known-distance", name, rule);
  };
  std::vector<const PoseGroup*> groups;
  for (const std::string& name : {known.first, known.second})
    for (const PoseGroup& group : files.groups)
      for (const std::size_t i : group.devices)
        if (files.devices[i].device.name == name) groups.push_back(&group);
  for (const std::string& name : {known.first, known.second}) {
    const ExchangedDevice* d = device_named(files.devices, name);
    if (d == nullptr || !d->given.pose) fail(name, "must be a device with a pose in the files");
  }
  if (groups.front() != groups.back())
    fail(known.second, "no pairs of the files join it to " + known.first);
  const double now = (device_named(files.devices, known.first)->device.center() -
                      device_named(files.devices, known.second)->device.center())
                         .norm();
  if (!(now > 0)) fail(known.second, "must not stand at " + known.first);
  return known.mm / now;
}

/// What the lengths of files and base are to each other.
class Scales {
 public:
  Scales(const ExchangeOptions& options, const MergedFiles& files, std::optional<double> ratio,
         std::vector<std::string> kept)
      : options_(options), files_(files), ratio_(ratio), kept_(std::move(kept)) {}

  void apply(UncalibratedRig& base, BasePlacement& placement) const {
    placement.unit_known = true;
    if (options_.known_distance) {
      placement.mm_per_unit = scale_by_distance(*options_.known_distance, files_);
    } else if (options_.unit_known) {
      placement.mm_per_unit = options_.mm_per_unit;
    } else {
      return take_from_base(base, placement);
    }
    if (kept_.empty()) return;
    if (base.rig.unit_known) return compare(placement);
    if (!ratio_)
      fail("--base", "\"unit\": \"unknown\"",
           "two devices with poses in both must say how long a unit of --base is, since it keeps " +
               list_text(kept_));
    base.rig = scaled(std::move(base.rig), placement.mm_per_unit / *ratio_);
    placement.notes.push_back("a unit of --base is " +
                              formatted(placement.mm_per_unit / *ratio_, "%.6g") +
                              " mm by the devices that are in both");
  }

 private:
  [[noreturn]] static void fail(const std::string& field, const std::string& value,
                                const std::string& rule) {
    throw InputError("command line", field, value, rule);
  }

  void take_from_base(const UncalibratedRig& base, BasePlacement& placement) const {
    placement.mm_per_unit = ratio_.value_or(1);
    placement.unit_known = ratio_ && base.rig.unit_known;
    if (ratio_) {
      placement.notes.push_back("a unit of the files is " + formatted(*ratio_, "%.6g") + " " +
                                unit_name(base.rig) + " by the devices that are in --base too");
    } else if (!kept_.empty()) {
      fail("--unit, --known-distance", "unknown",
           "one must be given: the files' lengths have no unit, and " + list_text(kept_) +
               " of --base keep theirs");
    }
  }

  void compare(BasePlacement& placement) const {
    if (!ratio_) return;
    const double off = *ratio_ / placement.mm_per_unit;
    if (std::abs(off - 1) <= options_.most_shift_share) return;
    const std::string rule = "by the devices that are in --base too, a unit of the files is " +
                             formatted(*ratio_, "%.6g") + " mm";
    constexpr double kUnitTolerance = 0.1;
    const bool is_another_unit = unit_behind_factor(off, kUnitTolerance) != nullptr ||
                                 unit_behind_factor(1 / off, kUnitTolerance) != nullptr;
    const std::string used = formatted(placement.mm_per_unit, "%.6g") + " mm";
    if (is_another_unit && !options_.known_distance)
      fail("--unit", used, "must fit what stays of --base: " + rule);
    placement.warnings.push_back(rule + ", not " + used + ": " + list_text(kept_) +
                                 " of --base may not fit");
  }

  const ExchangeOptions& options_;
  const MergedFiles& files_;
  std::optional<double> ratio_;
  std::vector<std::string> kept_;
};

/// base_from_files, after the files were scaled.
RigidTransform laid_onto(const std::vector<Common>& common, const MergedFiles& files) {
  const auto pose = [&](const Common& c) {
    return files.devices[c.device].device.device_from_world;
  };
  if (common.size() == 1) return common[0].in_base.inverse() * pose(common[0]);
  Vec3 middle = Vec3::Zero();
  for (const Common& c : common) middle += pose(c).inverse().translation;
  middle /= static_cast<double>(common.size());
  double spread = 0;
  for (const Common& c : common)
    spread = std::max(spread, (pose(c).inverse().translation - middle).norm());
  if (!(spread > 0)) spread = 1;
  Eigen::Matrix3Xd from(3, 4 * static_cast<Eigen::Index>(common.size()));
  Eigen::Matrix3Xd to(3, from.cols());
  for (std::size_t i = 0; i < common.size(); ++i) {
    for (int k = 0; k < 4; ++k) {
      const Vec3 beside = k == 0 ? Vec3(0, 0, 0) : Vec3(spread * Vec3::Unit(k - 1));
      const Eigen::Index column = 4 * static_cast<Eigen::Index>(i) + k;
      from.col(column) = pose(common[i]).inverse() * beside;
      to.col(column) = common[i].in_base.inverse() * beside;
    }
  }
  const Eigen::Matrix4d found = fit_similarity(from, to, false);
  return {found.topLeftCorner<3, 3>(), found.topRightCorner<3, 1>()};
}

/// Poses that should be the same, by the bounds of the options.
class Bounds {
 public:
  Bounds(const PoseGroup& group, const std::vector<Common>& common, const ExchangeOptions& options,
         const MergedFiles& files)
      : options_(options), files_(files) {
    const auto center = [&](std::size_t i) { return files.devices[i].device.center(); };
    for (const std::size_t a : group.devices)
      for (const std::size_t b : group.devices)
        reach_ = std::max(reach_, (center(a) - center(b)).norm());
    if (!(reach_ > 0)) reach_ = common[0].in_base.translation.norm();
  }

  [[nodiscard]] PoseDifference off(const RigidTransform& base_from_files, const Common& c) const {
    return difference(files_.devices[c.device].device.device_from_world * base_from_files.inverse(),
                      c.in_base);
  }
  /// 1: at the bound. Of one device at the origin no length tells how large a shift is.
  [[nodiscard]] double share(const PoseDifference& off) const {
    const double by_turn = off.turn_deg / options_.most_turn_deg;
    if (!(reach_ > 0)) return by_turn;
    return std::max(by_turn, off.shift / (options_.most_shift_share * reach_));
  }

 private:
  const ExchangeOptions& options_;
  const MergedFiles& files_;
  double reach_ = 0;  ///< of the group
};

/// By the most devices that agree with one of them, the first of equally many: one that moved
/// alone does not take the others with it.
RigidTransform laid_onto_most(const std::vector<Common>& common, const Bounds& bounds,
                              const MergedFiles& files) {
  std::vector<Common> most;
  for (const Common& one : common) {
    const RigidTransform move = laid_onto({one}, files);
    std::vector<Common> agreeing;
    for (const Common& c : common)
      if (&c == &one || bounds.share(bounds.off(move, c)) <= 1) agreeing.push_back(c);
    if (agreeing.size() > most.size()) most = std::move(agreeing);
  }
  return laid_onto(most, files);
}

/// How far devices are from where the base has them.
struct Misfit {
  double typical = 0;  ///< of the median device, 1: the bound
  double worst = 0;
  std::size_t device = 0;  ///< the worst
  PoseDifference difference;
};

Misfit misfit(const RigidTransform& base_from_files, const std::vector<Common>& common,
              const Bounds& bounds) {
  Misfit result;
  std::vector<double> shares;
  for (const Common& c : common) {
    const PoseDifference off = bounds.off(base_from_files, c);
    shares.push_back(bounds.share(off));
    if (shares.back() < result.worst) continue;
    result.worst = shares.back();
    result.device = c.device;
    result.difference = off;
  }
  result.typical = upper_median(std::move(shares));
  return result;
}

void move_group(const RigidTransform& base_from_files, const PoseGroup& group, MergedFiles& files) {
  const RigidTransform back = base_from_files.inverse();
  for (const std::size_t i : group.devices)
    files.devices[i].device.device_from_world = files.devices[i].device.device_from_world * back;
}

std::string names_of(const PoseGroup& group, const MergedFiles& files) {
  std::vector<std::string> names;
  for (const std::size_t i : group.devices) names.push_back(files.devices[i].device.name);
  return list_text(names);
}

/// Moves a group where that is called for, and says so. Stated poses stay, unless two devices or
/// more agree that their world is another one.
void lay_group(const PoseGroup& group, const std::vector<Common>& common, bool is_arbitrary,
               const ExchangeOptions& options, MergedFiles& files, BasePlacement& placement) {
  constexpr double kSameDigits = 1e-6;  // of the bound
  const std::string unit = placement.unit_known ? "mm" : "units";
  const Bounds bounds(group, common, options, files);
  const Misfit before = misfit({}, common, bounds);
  if (before.worst <= kSameDigits) return;
  const RigidTransform move = laid_onto_most(common, bounds, files);
  const Misfit after = misfit(move, common, bounds);
  const bool is_other_world = before.typical > 1 && common.size() > 1 && after.typical <= 1;
  const bool moves = is_arbitrary || is_other_world;
  if (moves) move_group(move, group, files);
  if (moves && group.is_stated && before.typical > 1)
    placement.notes.push_back(
        "the files have another world than --base: their devices were moved "
        "to where --base has " +
        std::string(common.size() == 1 ? "the one" : "those") + " that are in both");
  const Misfit& left = moves ? after : before;
  if (left.worst <= 1) return;
  const std::string text = files.devices[left.device].device.name + " stands " +
                           difference_text(left.difference, unit) +
                           " from where --base has it: what stays of --base fits only if that "
                           "device moved alone";
  (moves ? placement.warnings : placement.notes).push_back(text);
}

}  // namespace

BasePlacement lay_into_base(bool world_is_arbitrary, const ExchangeOptions& options,
                            MergedFiles& files, UncalibratedRig& base) {
  BasePlacement placement;
  std::vector<std::vector<Common>> common;
  for (const PoseGroup& group : files.groups) common.push_back(common_devices(group, files, base));
  std::vector<std::string> kept = kept_devices(files, base);
  // Groups of pairs need something to hold on to, but for the first one that is alone.
  const bool is_alone = kept.empty() && std::all_of(common.begin(), common.end(),
                                                    [](const auto& c) { return c.empty(); });
  for (std::size_t g = 0; g < files.groups.size();) {
    const PoseGroup& group = files.groups[g];
    if (group.is_stated || !common[g].empty() || (is_alone && g == 0)) {
      ++g;
      continue;
    }
    placement.warnings.push_back("nothing says where " + names_of(group, files) +
                                 " stand: no file joins them to the other devices");
    for (const std::size_t i : group.devices) files.devices[i].given.pose = false;
    files.groups.erase(files.groups.begin() + static_cast<std::ptrdiff_t>(g));
    common.erase(common.begin() + static_cast<std::ptrdiff_t>(g));
  }
  placement.is_any_placed = !files.groups.empty();
  if (!placement.is_any_placed) {
    if (options.known_distance) (void)scale_by_distance(*options.known_distance, files);
    return placement;
  }
  if (base.rig.volume) kept.emplace_back("volume");
  if (base.rig.floor) kept.emplace_back("floor");
  Scales(options, files, base_per_file(common, files), kept).apply(base, placement);
  for (ExchangedDevice& d : files.devices)
    d.device.device_from_world.translation *= placement.mm_per_unit;
  for (std::size_t g = 0; g < files.groups.size(); ++g) {
    const PoseGroup& group = files.groups[g];
    const bool is_arbitrary = world_is_arbitrary || !group.is_stated;
    const bool matters = !kept.empty() || files.groups.size() > 1 || !group.is_stated;
    if (!matters) continue;
    common[g] = common_devices(group, files, base);  // the base may have been scaled
    if (!common[g].empty())
      lay_group(group, common[g], is_arbitrary, options, files, placement);
    else if (!kept.empty())
      (is_arbitrary ? placement.warnings : placement.notes)
          .push_back("no device has a pose in both the files and --base: " + list_text(kept) +
                     " of --base fit only if both have the same world");
  }
  return placement;
}

}  // namespace pencilscan
