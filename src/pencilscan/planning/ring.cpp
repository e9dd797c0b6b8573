#include "pencilscan/planning/ring.h"

#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "pencilscan/core/error.h"
#include "pencilscan/pattern/de_bruijn.h"

namespace pencilscan {
namespace {

constexpr double kFullCircle = 2 * std::numbers::pi;

Device device_at(const std::string& name, std::pair<int, int> size, double focal_px,
                 double distance_mm, double azimuth_rad, double elevation_rad,
                 double roll_rad = 0) {
  Device device;
  device.name = name;
  device.width = size.first;
  device.height = size.second;
  device.K << focal_px, 0, 0.5 * (size.first - 1), 0, focal_px, 0.5 * (size.second - 1), 0, 0, 1;
  const Vec3 eye(std::cos(elevation_rad) * std::cos(azimuth_rad),
                 std::cos(elevation_rad) * std::sin(azimuth_rad), std::sin(elevation_rad));
  device.device_from_world = look_at(distance_mm * eye, Vec3::Zero(), roll_rad);
  return device;
}

/// Device i of `count` on an arc centred at azimuth 0, or on the whole circle from azimuth 0 on;
/// `shift` (in steps) puts the projectors between the cameras.
double azimuth(int i, int count, double arc_rad, double shift) {
  const double step = arc_rad / count;
  if (arc_rad >= kFullCircle) return step * (i + shift);
  return step * (i + 0.5) - 0.5 * arc_rad + step * (shift - 0.25);
}

/// The entry of projector i in a list that repeats.
template <typename Entry>
const Entry& in_turn(const std::vector<Entry>& entries, int i) {
  return entries[static_cast<std::size_t>(i) % entries.size()];
}

void require(bool holds, const char* field, const std::string& value, const char* rule) {
  if (!holds) throw InputError("ring", field, value, rule);
}

void check_ring(const RingOptions& options) {
  require(options.cameras >= 1, "cameras", std::to_string(options.cameras), "must be >= 1");
  require(options.projectors >= 1, "projectors", std::to_string(options.projectors),
          "must be >= 1");
  require(options.volume_radius_mm > 0, "volume_radius_mm",
          std::to_string(options.volume_radius_mm), "must be > 0");
  require(options.distance_mm > options.volume_radius_mm, "distance_mm",
          std::to_string(options.distance_mm), "must be larger than volume_radius_mm");
  require(options.arc_rad > 0 && options.arc_rad <= kFullCircle, "arc_rad",
          std::to_string(options.arc_rad), "must be in (0, 2 pi]");
  require(!options.axes.empty(), "axes", "", "must not be empty");
  require(!options.rolls_rad.empty(), "rolls_rad", "", "must not be empty");
  require(!options.colors.empty(), "colors", "", "must not be empty");
  for (const std::vector<PatternColor>& colors : options.colors) {
    require(!colors.empty(), "colors", "", "must have at least one colour for each projector");
    const bool has_code = options.order >= 1 && std::pow(colors.size(), options.order) <= 1 << 20;
    require(has_code || colors.size() == 1, "order", std::to_string(options.order),
            "must be >= 1, and colours^order <= 2^20");
  }
}

LinePattern ring_pattern(const RingOptions& options, int projector) {
  LinePattern pattern;
  pattern.axis = in_turn(options.axes, projector);
  pattern.colors = in_turn(options.colors, projector);
  pattern.alphabet = static_cast<int>(pattern.colors.size());
  pattern.order = pattern.alphabet == 1 ? 1 : options.order;
  pattern.sequence = pattern.alphabet == 1 ? std::vector<int>{0}
                                           : de_bruijn_sequence(pattern.alphabet, pattern.order);
  pattern.pitch_px = options.pitch_px;
  pattern.line_width_px = options.line_width_px;
  pattern.offset_px = options.offset_px;
  return pattern;
}

}  // namespace

Rig make_ring(const RingOptions& options) {
  check_ring(options);
  Rig rig;
  // On an arc, equal numbers would put each projector right above a camera: move both by a quarter.
  const bool full = options.arc_rad >= kFullCircle;
  const bool paired = options.cameras == options.projectors;
  const double camera_shift = full ? 0.0 : (paired ? 0.0 : 0.25);
  const double projector_shift = full ? 0.5 : (paired ? 0.5 : 0.25);
  for (int i = 0; i < options.cameras; ++i) {
    Camera camera;
    static_cast<Device&>(camera) = device_at(
        "cam" + std::to_string(i), {options.camera_width, options.camera_height},
        options.camera_focal_px, options.distance_mm,
        azimuth(i, options.cameras, options.arc_rad, camera_shift), options.camera_elevation_rad);
    rig.cameras.push_back(std::move(camera));
  }
  for (int i = 0; i < options.projectors; ++i) {
    const bool vertical = in_turn(options.axes, i) == Axis::kColumn;
    Projector projector;
    static_cast<Device&>(projector) =
        device_at("proj" + std::to_string(i), {options.projector_width, options.projector_height},
                  options.projector_focal_px, options.distance_mm,
                  azimuth(i, options.projectors, options.arc_rad, projector_shift),
                  vertical ? options.vertical_elevation_rad : options.horizontal_elevation_rad,
                  in_turn(options.rolls_rad, i));
    projector.patterns = {ring_pattern(options, i)};
    rig.projectors.push_back(std::move(projector));
  }
  rig.volume = Sphere{Vec3::Zero(), options.volume_radius_mm};
  return rig;
}

}  // namespace pencilscan
