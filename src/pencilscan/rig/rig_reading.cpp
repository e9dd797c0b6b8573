#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "pencilscan/geometry/rotation.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/json_text.h"
#include "pencilscan/pattern/de_bruijn.h"
#include "pencilscan/rig/devices_file.h"
#include "pencilscan/rig/json_field.h"
#include "pencilscan/rig/rig.h"
#include "pencilscan/rig/rig_text.h"

namespace pencilscan {
namespace {

constexpr int kLargestImage = 1 << 16;     ///< px a side
constexpr int kLongestPeriod = 1 << 20;    ///< symbols of a de Bruijn sequence
constexpr std::size_t kMostDevices = 256;  ///< points.ply numbers them in one byte
constexpr int kMostLines = 1 << 16;        ///< points.ply numbers them in two bytes

Mat3 parse_camera_matrix(const JsonField& field) {
  const Mat3 K = field.matrix3();
  const auto rows = field.entries(3);
  const auto entry = [&](std::size_t row, std::size_t column) {
    return rows[row].entries(3)[column];
  };
  for (std::size_t k = 0; k < 2; ++k) (void)entry(k, k).positive();
  const Mat3 lower = K.triangularView<Eigen::StrictlyLower>();
  for (std::size_t row = 1; row < 3; ++row) {
    for (std::size_t column = 0; column < row; ++column) {
      if (lower(static_cast<int>(row), static_cast<int>(column)) != 0) {
        entry(row, column).fail("must be 0");
      }
    }
  }
  if (K(2, 2) != 1) entry(2, 2).fail("must be 1");
  return K;
}

Mat3 parse_rotation(const JsonField& field) {
  const Mat3 R = field.matrix3();
  if (rotation_error(R) > kRotationTolerance)
    field.fail("must be a rotation: the entries of |R R' - I| must be <= 1e-4");
  if (R.determinant() < 0) field.fail("must be a rotation, is a reflection: det R must be 1");
  return R;
}

/// The name becomes a file or folder name, with endings such as "_raw.png" behind it: file systems
/// take 255 bytes.
std::string parse_name(const JsonField& field) {
  std::string name = field.text();
  constexpr std::size_t kMostBytes = 200;
  if (name.size() > kMostBytes) field.fail("must have at most 200 bytes: files are named after it");
  const bool usable = !name.empty() && name != "." && name != ".." &&
                      std::none_of(name.begin(), name.end(), [](char c) {
                        return c == '/' || c == '\\' || static_cast<unsigned char>(c) < 0x20;
                      });
  if (!usable) field.fail("must be usable as a file name");
  return name;
}

/// A calibration cannot start from a focal length in millimetres.
void check_is_in_pixels(const JsonField& field, const Device& device) {
  constexpr double kLeastPerWidth = 0.13;  // sees 150 degrees, more than these lens models hold for
  for (std::size_t k = 0; k < 2; ++k) {
    const double size = k == 0 ? device.width : device.height;
    if (device.K(static_cast<int>(k), static_cast<int>(k)) < kLeastPerWidth * size)
      field.entries(3)[k].entries(3)[k].fail(
          "must be in pixels (millimetres over the width of a pixel): this would see more than 150 "
          "degrees");
  }
}

/// What cameras and projectors have in common. With `given`, the calibration may be missing.
void parse_device(const JsonField& field, Device& device, GivenCalibration* given) {
  device.name = parse_name(field.at("name"));
  device.width = field.at("width").integer(1, kLargestImage);
  device.height = field.at("height").integer(1, kLargestImage);
  if (given != nullptr) {
    *given = {field.has("K"), field.has("distortion"), field.has("R") || field.has("t")};
  }
  if (given == nullptr || given->K) device.K = parse_camera_matrix(field.at("K"));
  if (given != nullptr && given->K) check_is_in_pixels(field.at("K"), device);
  if (given == nullptr || given->distortion) {
    const auto distortion = field.at("distortion").entries();
    if (distortion.size() != Distortion::kBrown && distortion.size() != Distortion::kCoefficients)
      field.at("distortion").fail("must be a list of 5 or 8");
    for (std::size_t k = 0; k < distortion.size(); ++k)
      device.distortion[k] = distortion[k].number();
  }
  if (given == nullptr || given->pose)
    device.device_from_world = {parse_rotation(field.at("R")), field.at("t").vector3()};
}

ColorRegistration parse_color_registration(const JsonField& field) {
  field.check_keys({}, {"red", "green", "blue"});
  ColorRegistration registration;
  for (std::size_t k = 0; k < kColorNames.size(); ++k) {
    if (!field.has(kColorNames[k])) continue;
    const JsonField color = field.at(kColorNames[k]);
    color.check_keys({"shift_px"}, {"scale"});
    const auto shift = color.at("shift_px").entries(2);
    registration.colors[k].shift_px = {shift[0].number(), shift[1].number()};
    if (color.has("scale")) registration.colors[k].scale = color.at("scale").positive();
  }
  return registration;
}

/// Keys of a device's calibration: all of them, or none is required.
void check_device_keys(const JsonField& field, std::initializer_list<const char*> optional,
                       bool calibrated) {
  std::vector<const char*> required{"name", "width", "height"};
  std::vector<const char*> others(optional);
  for (const char* key : {"K", "distortion", "R", "t"})
    (calibrated ? required : others).push_back(key);
  field.check_keys(required, others);
}

/// Shortest length at which all windows of the cyclic sequence differ (the whole period if none).
int distinguishing_order(const std::vector<int>& sequence) {
  const std::size_t period = sequence.size();
  for (std::size_t order = 1; order < period; ++order) {
    std::set<std::vector<int>> windows;
    for (std::size_t i = 0; i < period; ++i) {
      std::vector<int> window;
      for (std::size_t k = 0; k < order; ++k) window.push_back(sequence[(i + k) % period]);
      windows.insert(std::move(window));
    }
    if (windows.size() == period) return static_cast<int>(order);
  }
  return static_cast<int>(period);
}

void parse_sequence(const JsonField& field, LinePattern& pattern) {
  const auto symbols = field.entries();
  if (symbols.empty() || symbols.size() > kLongestPeriod) {
    field.fail("must have 1 to 2^20 symbols");
  }
  pattern.sequence.clear();
  for (const JsonField& symbol : symbols) {
    pattern.sequence.push_back(symbol.integer(0, pattern.alphabet - 1));
  }
}

/// A name, or the linear light of red, green and blue.
PatternColor parse_color(const JsonField& field) {
  if (!field.is_array()) {
    const std::string name = field.text();
    if (!color_from_name(name)) {
      field.fail("must be blue, cyan, red, yellow, green, magenta or white, or [r, g, b]");
    }
    return PatternColor(name);
  }
  const auto numbers = field.entries(3);
  Rgb light{};
  for (std::size_t k = 0; k < 3; ++k) {
    light[k] = numbers[k].number();
    if (light[k] < 0 || light[k] > 1) numbers[k].fail("must be in [0, 1]");
  }
  if (light == Rgb{}) field.fail("must not be all 0: a black line shows nothing");
  return PatternColor(light);
}

/// colors, alphabet, order and sequence.
void parse_code(const JsonField& field, LinePattern& pattern) {
  const auto colors = field.at("colors").entries();
  if (colors.empty()) field.at("colors").fail("must have at least one colour");
  pattern.colors.clear();
  for (const JsonField& color : colors) {
    pattern.colors.push_back(parse_color(color));
  }
  pattern.alphabet = static_cast<int>(colors.size());
  const bool coded = pattern.alphabet > 1;
  if (coded || field.has("alphabet")) {
    const JsonField alphabet = field.at("alphabet");
    if (alphabet.integer(1, kLongestPeriod) != pattern.alphabet) {
      alphabet.fail("must be the number of colors, " + std::to_string(pattern.alphabet));
    }
  }
  const bool own_sequence = field.has("sequence");
  pattern.order = 1;
  if (field.has("order") || (coded && !own_sequence)) {
    pattern.order = field.at("order").integer(1, 20);
    if (std::pow(pattern.alphabet, pattern.order) > kLongestPeriod) {
      field.at("order").fail("alphabet^order must be <= 2^20");
    }
  }
  if (own_sequence) {
    parse_sequence(field.at("sequence"), pattern);
    pattern.has_own_sequence = coded;
    if (!field.has("order")) pattern.order = distinguishing_order(pattern.sequence);
  } else if (coded) {
    pattern.sequence = de_bruijn_sequence(pattern.alphabet, pattern.order);
  }
  if (!coded) {  // lines without a code: one local ID
    pattern.sequence = {0};
    pattern.order = 1;
  }
}

LinePattern parse_pattern(const JsonField& field, const Projector& projector) {
  field.check_keys({"orientation", "colors", "pitch_px", "line_width_px", "offset_px"},
                   {"alphabet", "order", "sequence", "lines"});
  LinePattern pattern;
  const std::string orientation = field.at("orientation").text();
  if (orientation != "vertical" && orientation != "horizontal") {
    field.at("orientation").fail("must be \"vertical\" or \"horizontal\"");
  }
  pattern.axis = orientation == "vertical" ? Axis::kColumn : Axis::kRow;
  parse_code(field, pattern);
  pattern.pitch_px = field.at("pitch_px").positive();
  pattern.line_width_px = field.at("line_width_px").positive();
  if (pattern.line_width_px > pattern.pitch_px) {
    field.at("line_width_px").fail("must be <= pitch_px");
  }
  pattern.offset_px = field.at("offset_px").number();
  const int size = projector.size_across(pattern);
  if (pattern.offset_px < -0.5 || pattern.offset_px > size - 0.5) {
    field.at("offset_px")
        .fail("the first line must lie on the panel: from -0.5 to " + std::to_string(size) +
              " - 0.5");
  }
  if (field.has("lines")) pattern.max_lines = field.at("lines").integer(1, kMostLines);
  if ((size - pattern.offset_px) / pattern.pitch_px >= kMostLines) {
    field.at("pitch_px").fail("must give at most 65536 lines");
  }
  return pattern;
}

Projector parse_projector(const JsonField& field, GivenCalibration* given) {
  check_device_keys(field, {"pattern", "color_registration", "output"}, given == nullptr);
  Projector projector;
  parse_device(field, projector, given);
  if (field.has("output")) {
    projector.output = field.at("output").text();
    if (projector.output.empty()) field.at("output").fail("must not be empty");
  }
  if (field.has("color_registration"))
    projector.color_registration = parse_color_registration(field.at("color_registration"));
  if (!field.has("pattern")) return projector;
  const JsonField pattern = field.at("pattern");
  if (pattern.is_object()) {
    projector.patterns.push_back(parse_pattern(pattern, projector));
    return projector;
  }
  if (!pattern.is_array()) pattern.fail("must be an object or a list of objects");
  for (const JsonField& entry : pattern.entries()) {
    projector.patterns.push_back(parse_pattern(entry, projector));
  }
  if (projector.patterns.empty()) pattern.fail("a list of patterns must not be empty");
  return projector;
}

/// Camera RGB = matrix * projector RGB, solved for the projector's.
Mat3 parse_color_matrix(const JsonField& field) {
  const Mat3 matrix = field.matrix3();
  if (!matrix.fullPivLu().isInvertible())
    field.fail("must be invertible: it takes different colours for one");
  return matrix;
}

Camera parse_camera(const JsonField& field, const std::vector<Projector>& projectors,
                    GivenCalibration* given) {
  check_device_keys(
      field, {"color_matrix", "color_registration", "gamma", "black_level", "mosaic", "role"},
      given == nullptr);
  Camera camera;
  parse_device(field, camera, given);
  if (field.has("color_registration"))
    camera.color_registration = parse_color_registration(field.at("color_registration"));
  if (field.has("gamma")) camera.gamma = field.at("gamma").positive();
  if (field.has("black_level")) {
    camera.black_level = field.at("black_level").number();
    if (camera.black_level < 0 || camera.black_level >= 1)
      field.at("black_level").fail("must be in [0, 1)");
  }
  if (field.has("mosaic")) {
    camera.mosaic = Mosaic::from_name(field.at("mosaic").text());
    if (!camera.mosaic) field.at("mosaic").fail("must be RGGB, BGGR, GRBG or GBRG");
    if (camera.width < 2 || camera.height < 2)
      field.at("mosaic").fail("needs an image of at least 2x2 pixels");
  }
  if (field.has("role")) {
    if (field.at("role").text() != "texture") field.at("role").fail("must be \"texture\"");
    camera.sees_texture_only = true;
  }
  if (!field.has("color_matrix")) return camera;
  const JsonField matrix = field.at("color_matrix");
  if (!matrix.is_object()) {
    if (!matrix.is_array()) matrix.fail("must be a 3x3 matrix or an object by projector name");
    camera.color_matrix = parse_color_matrix(matrix);
    return camera;
  }
  for (const auto& [name, entry] : matrix.members()) {
    const bool known = std::any_of(projectors.begin(), projectors.end(),
                                   [&, &of = name](const Projector& p) { return p.name == of; });
    if (!known) entry.fail("there is no projector of this name");
    camera.color_matrix_by_projector[name] = parse_color_matrix(entry);
  }
  return camera;
}

std::vector<JsonField> parse_device_list(const JsonField& field) {
  const auto entries = field.entries();
  if (entries.empty() || entries.size() > kMostDevices) field.fail("must have 1 to 256 devices");
  std::set<std::string> names;
  for (const JsonField& entry : entries) {
    if (!entry.is_object()) entry.fail("must be an object");
    if (!names.insert(entry.at("name").text()).second) {
      entry.at("name").fail("names must differ from each other");
    }
  }
  return entries;
}

Sphere parse_volume(const JsonField& field) {
  field.check_keys({"center", "radius"}, {});
  return {field.at("center").vector3(), field.at("radius").positive()};
}

Floor parse_floor(const JsonField& field) {
  field.check_keys({"point", "normal"}, {});
  const Vec3 normal = field.at("normal").vector3();
  const double length = normal.norm();
  if (!(length > 0) || !std::isfinite(length))
    field.at("normal").fail("must be a direction, longer than 0");
  return {field.at("point").vector3(), normal / length};
}

/// A rig, or with `given` one whose devices may lack their calibration.
Rig parse_rig(const std::string& name, const nlohmann::json& json,
              std::vector<GivenCalibration>* given) {
  const JsonField root(name, json);
  root.check_keys({"format", "unit", "cameras", "projectors"}, {"volume", "floor"});
  if (root.at("format").text() != "rig/1") root.at("format").fail("must be \"rig/1\"");
  const std::string unit = root.at("unit").text();
  if (unit != "mm" && unit != "unknown") root.at("unit").fail("must be \"mm\" or \"unknown\"");
  Rig rig;
  rig.unit_known = unit == "mm";
  std::vector<GivenCalibration> of_projectors;
  for (const JsonField& entry : parse_device_list(root.at("projectors"))) {
    of_projectors.emplace_back();
    rig.projectors.push_back(parse_projector(entry, given ? &of_projectors.back() : nullptr));
  }
  std::size_t patterns = 0;
  for (const Projector& projector : rig.projectors) patterns += projector.patterns.size();
  if (patterns > kMostPatterns) root.at("projectors").fail("must show at most 256 patterns in all");
  for (const JsonField& entry : parse_device_list(root.at("cameras"))) {
    if (given != nullptr) given->emplace_back();
    rig.cameras.push_back(parse_camera(entry, rig.projectors, given ? &given->back() : nullptr));
  }
  if (given != nullptr) given->insert(given->end(), of_projectors.begin(), of_projectors.end());
  if (root.has("volume")) rig.volume = parse_volume(root.at("volume"));
  if (root.has("floor")) rig.floor = parse_floor(root.at("floor"));
  return rig;
}

}  // namespace

Rig read_rig(const std::filesystem::path& path) {
  return parse_rig(path.string(), read_json(path), nullptr);
}

Rig rig_from_text(const std::string& text, const std::string& name) {
  return parse_rig(name, parse_json(text, name), nullptr);
}

UncalibratedRig read_devices(const std::filesystem::path& path) {
  UncalibratedRig result;
  result.rig = parse_rig(path.string(), read_json(path), &result.given);
  return result;
}

UncalibratedRig devices_from_text(const std::string& text, const std::string& name) {
  UncalibratedRig result;
  result.rig = parse_rig(name, parse_json(text, name), &result.given);
  return result;
}

}  // namespace pencilscan
