#include <algorithm>
#include <nlohmann/json.hpp>
#include <span>

#include "pencilscan/io/file.h"
#include "pencilscan/rig/devices_file.h"
#include "pencilscan/rig/rig.h"
#include "pencilscan/rig/rig_text.h"

namespace pencilscan {
namespace {

using Json = nlohmann::ordered_json;

Json to_json(const Vec3& v) { return Json::array({v.x(), v.y(), v.z()}); }

Json to_json(const Mat3& m) {
  Json rows = Json::array();
  for (int row = 0; row < 3; ++row) rows.push_back(to_json(Vec3(m.row(row).transpose())));
  return rows;
}

/// What is given of a device.
Json device_to_json(const Device& device, const GivenCalibration& given) {
  Json json;
  json["name"] = device.name;
  json["width"] = device.width;
  json["height"] = device.height;
  if (given.K) json["K"] = to_json(device.K);
  if (given.distortion) json["distortion"] = device.distortion.stated();
  if (given.pose) {
    json["R"] = to_json(device.device_from_world.rotation);
    json["t"] = to_json(device.device_from_world.translation);
  }
  return json;
}

void add_color_registration(const ColorRegistration& registration, Json& device) {
  for (std::size_t k = 0; k < kColorNames.size(); ++k) {
    const ColorDisplacement& color = registration.colors[k];
    if (color.none()) continue;
    Json& json = device["color_registration"][kColorNames[k]];
    json["shift_px"] = {color.shift_px.x(), color.shift_px.y()};
    if (color.scale != 1) json["scale"] = color.scale;
  }
}

Json pattern_to_json(const LinePattern& pattern) {
  Json json;
  json["orientation"] = pattern.axis == Axis::kColumn ? "vertical" : "horizontal";
  json["colors"] = Json::array();
  for (const PatternColor& color : pattern.colors) {
    if (color.stated_by_name())
      json["colors"].push_back(color.text());
    else
      json["colors"].push_back(color.light());
  }
  if (pattern.alphabet > 1) {
    json["alphabet"] = pattern.alphabet;
    json["order"] = pattern.order;
  }
  json["pitch_px"] = pattern.pitch_px;
  json["line_width_px"] = pattern.line_width_px;
  json["offset_px"] = pattern.offset_px;
  if (pattern.has_own_sequence) json["sequence"] = pattern.sequence;
  if (pattern.max_lines) json["lines"] = *pattern.max_lines;
  return json;
}

Json camera_to_json(const Camera& camera, const GivenCalibration& given) {
  Json json = device_to_json(camera, given);
  if (!camera.color_matrix_by_projector.empty()) {
    Json matrices = Json::object();
    for (const auto& [name, matrix] : camera.color_matrix_by_projector) {
      matrices[name] = to_json(matrix);
    }
    json["color_matrix"] = matrices;
  } else if (camera.color_matrix) {
    json["color_matrix"] = to_json(*camera.color_matrix);
  }
  add_color_registration(camera.color_registration, json);
  if (camera.gamma != 1) json["gamma"] = camera.gamma;
  if (camera.black_level != 0) json["black_level"] = camera.black_level;
  if (camera.mosaic) json["mosaic"] = camera.mosaic->name();
  if (camera.sees_texture_only) json["role"] = "texture";
  return json;
}

Json projector_to_json(const Projector& projector, const GivenCalibration& given) {
  Json json = device_to_json(projector, given);
  if (!projector.output.empty()) json["output"] = projector.output;
  add_color_registration(projector.color_registration, json);
  if (projector.patterns.size() == 1) {
    json["pattern"] = pattern_to_json(projector.patterns.front());
  } else if (!projector.patterns.empty()) {
    json["pattern"] = Json::array();
    for (const LinePattern& pattern : projector.patterns) {
      json["pattern"].push_back(pattern_to_json(pattern));
    }
  }
  return json;
}

/// Indented JSON with lists of plain values, and lists of such lists, on one line.
std::string pretty(const Json& value, int depth = 0) {
  const auto is_flat = [](const Json& list) {
    return std::none_of(list.begin(), list.end(), [](const Json& entry) {
      return entry.is_object() ||
             (entry.is_array() && std::any_of(entry.begin(), entry.end(),
                                              [](const Json& x) { return x.is_structured(); }));
    });
  };
  if (!value.is_structured() || value.empty() || (value.is_array() && is_flat(value))) {
    return value.dump();
  }
  const std::string indent(static_cast<std::size_t>(depth) + 1, ' ');
  std::string text = value.is_object() ? "{" : "[";
  bool first = true;
  for (const auto& [key, entry] : value.items()) {
    text += (first ? "\n" : ",\n") + indent;
    if (value.is_object()) text += Json(key).dump() + ": ";
    text += pretty(entry, depth + 1);
    first = false;
  }
  return text + "\n" + indent.substr(1) + (value.is_object() ? "}" : "]");
}

std::string devices_text(const Rig& rig, std::span<const GivenCalibration> all_given) {
  auto given = all_given.begin();
  Json json;
  json["format"] = "rig/1";
  json["unit"] = rig.unit_known ? "mm" : "unknown";
  json["cameras"] = Json::array();
  for (const Camera& camera : rig.cameras)
    json["cameras"].push_back(camera_to_json(camera, *given++));
  json["projectors"] = Json::array();
  for (const Projector& projector : rig.projectors)
    json["projectors"].push_back(projector_to_json(projector, *given++));
  if (rig.volume) {
    json["volume"] = {{"center", to_json(rig.volume->center)}, {"radius", rig.volume->radius}};
  }
  if (rig.floor) {
    json["floor"] = {{"point", to_json(rig.floor->point)}, {"normal", to_json(rig.floor->normal)}};
  }
  return pretty(json) + "\n";
}

}  // namespace

void write_devices(const UncalibratedRig& devices, const std::filesystem::path& path) {
  write_text(path, devices_text(devices.rig, devices.given));
}

std::string rig_text(const Rig& rig) {
  constexpr GivenCalibration kAll{true, true, true};
  return devices_text(rig, std::vector(rig.cameras.size() + rig.projectors.size(), kAll));
}

void write_rig(const Rig& rig, const std::filesystem::path& path) {
  write_text(path, rig_text(rig));
}

}  // namespace pencilscan
