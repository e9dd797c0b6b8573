#include "pencilscan/planning/units.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "pencilscan/core/length_units.h"
#include "pencilscan/core/median.h"
#include "pencilscan/rig/device_list.h"

namespace pencilscan {
namespace {

/// Seldom enough to be thought of only where no other unit explains the size.
constexpr std::array kSeldomMeshUnits =
    std::to_array<UnitFactor>({{100, "decimetres instead of millimetres"}});
constexpr std::array kUnitOfRig = std::to_array<UnitFactor>({{1, "the rig's unit already"}});

// Shares of the volume's radius. An object that reaches a tenth of it is crossed by a tenth of the
// lines, which is poor but may be meant; the volume "holds the object", so twice of it cannot be.
constexpr double kSmallestShare = 0.1;
constexpr double kLargestShare = 2;
/// What a unit has to make of the object to explain its size: at least a quarter, and no more than
/// touches the volume's corners.
constexpr double kExplainedFrom = 0.25;
constexpr double kExplainedTo = 1.5;
/// The share that is looked for among several units: what --fit would give.
constexpr double kUsualShare = 0.95;

// Radius of the volume over the median distance of the devices to its centre. From inside of the
// volume nothing is seen whole; of a volume a hundredth of the distance in size, a camera of 60
// degrees has 18 pixels in 1000.
constexpr double kSmallestVolume = 0.01;
constexpr double kLargestVolume = 1;

/// "0.24" or "1700": three digits.
std::string rounded(double value) {
  std::array<char, 32> text{};
  const auto end =
      std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::general, 3)
          .ptr;
  std::string digits(text.data(), end);
  if (digits.find('e') == std::string::npos || std::abs(value) < 1e-4 || std::abs(value) > 1e9)
    return digits;
  return std::to_string(std::llround(value));
}

/// As an argument of --scale: as exact as the unit.
std::string factor_text(double factor) {
  std::array<char, 32> text{};
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), factor,
                                     std::chars_format::general, 6)
                           .ptr};
}

/// Largest distance of a vertex from the middle of the bounding box.
double reach_of(const TriangleMesh& object) {
  const BoundingBox box = bounding_box(object);
  const Vec3 middle = 0.5 * (box.low + box.high);
  double reach = 0;
  for (const Vec3& v : object.vertices) reach = std::max(reach, (v - middle).norm());
  return reach;
}

/// The unit of these that explains a share of the volume; null: none does.
const UnitFactor* unit_behind(double share, std::span<const UnitFactor> units) {
  const UnitFactor* best = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const UnitFactor& unit : units) {
    const double explained = share * unit.factor;
    if (explained < kExplainedFrom || explained > kExplainedTo) continue;
    const double off = std::abs(std::log(explained / kUsualShare));
    if (off < least) best = &unit;
    least = std::min(least, off);
  }
  return best;
}

/// The unit of a file whose lengths, as they stand there, are this share of the volume.
const UnitFactor* unit_of_mesh(double share, const Rig& rig) {
  if (const UnitFactor* unit = unit_behind(share, kUnitOfRig)) return unit;
  if (!rig.unit_known) return unit_behind(share, kUnitFactors);
  const UnitFactor* unit = unit_behind(share, kInsteadOfMillimetres);
  return unit != nullptr ? unit : unit_behind(share, kSeldomMeshUnits);
}

bool sees(const Device& device, const Vec3& point) {
  const auto pixel = device.project(point);
  return pixel && pixel->x() >= 0 && pixel->y() >= 0 && pixel->x() < device.width &&
         pixel->y() < device.height;
}

/// A volume that devices may stand around: half of the cameras see its middle, from a distance in
/// proportion.
bool is_plausible(const Rig& rig, const Sphere& volume) {
  std::size_t seeing = 0;
  std::vector<double> distances;
  for (const Camera& camera : rig.cameras) {
    seeing += sees(camera, volume.center) ? 1 : 0;
    distances.push_back((camera.center() - volume.center).norm());
  }
  const double share = volume.radius / upper_median(std::move(distances));
  return 2 * seeing >= rig.cameras.size() && share >= kSmallestVolume && share <= kLargestVolume;
}

}  // namespace

std::optional<std::string> object_unit_warning(const TriangleMesh& object, const Rig& rig,
                                               double scale) {
  const double reach = reach_of(object);
  const Sphere volume = working_volume(rig);
  if (!(reach > 0) || !(volume.radius > 0)) return std::nullopt;
  const double share = reach / volume.radius;
  if (share >= kSmallestShare && share <= kLargestShare) return std::nullopt;
  const UnitFactor* unit = unit_of_mesh(share / scale, rig);
  std::string text = "the object is " + rounded(2 * reach) + " " + unit_name(rig) + " large" +
                     (scale == 1 ? "" : " with --scale " + factor_text(scale)) +
                     " and the rig's volume " + rounded(2 * volume.radius) + " " + unit_name(rig);
  if (unit != nullptr) {
    text += ": the mesh is probably in " + std::string(unit->words) + ". --scale " +
            factor_text(unit->factor) + " makes it right, --fit makes it fit";
  } else {
    text += ": --fit makes it fit, --scale multiplies it";
  }
  return text;
}

std::optional<std::string> pose_unit_warning(const Rig& rig) {
  // A lens of a camera is some millimetres wide and a projector's more; no pattern is seen from a
  // kilometre.
  constexpr double kNearestMm = 10;
  constexpr double kFarthestMm = 1e6;
  if (!rig.unit_known || device_count(rig) < 2) return std::nullopt;
  double farthest = 0;
  for (std::size_t a = 0; a < device_count(rig); ++a) {
    for (std::size_t b = 0; b < a; ++b)
      farthest =
          std::max(farthest, (device_at(rig, a).center() - device_at(rig, b).center()).norm());
  }
  if (farthest >= kNearestMm && farthest <= kFarthestMm) return std::nullopt;
  if (!(farthest > 0)) return std::nullopt;  // that is no matter of units
  std::string text = "the devices that are farthest apart are so by " + rounded(farthest) + " mm";
  text += farthest < kNearestMm ? ": t is probably in metres: multiply it by 1000"
                                : ": t is probably in micrometres: multiply it by 0.001";
  return text + ", with the volume and the floor, or state \"unit\": \"unknown\"";
}

std::optional<std::string> volume_unit_warning(const Rig& rig) {
  if (!rig.volume || rig.cameras.empty() || is_plausible(rig, *rig.volume)) return std::nullopt;
  std::vector<double> distances;
  for (const Camera& camera : rig.cameras)
    distances.push_back((camera.center() - rig.volume->center).norm());
  std::string text = "the rig's volume cannot be what its cameras look at: its radius is " +
                     rounded(rig.volume->radius) + ", their distance to its centre " +
                     rounded(upper_median(std::move(distances))) + " " + unit_name(rig);
  for (const UnitFactor& unit : kUnitFactors) {
    const Sphere other{unit.factor * rig.volume->center, unit.factor * rig.volume->radius};
    if (!is_plausible(rig, other)) continue;
    return text + "; \"volume\" is probably in " + unit.words + ": multiply it by " +
           factor_text(unit.factor) + ", or t of all devices by " + factor_text(1 / unit.factor);
  }
  return text + "; check \"volume\" in rig.json, or leave it out";
}

}  // namespace pencilscan
