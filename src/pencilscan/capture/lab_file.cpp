#include "pencilscan/capture/lab_file.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "pencilscan/capture/aravis_cameras.h"
#include "pencilscan/capture/file_cameras.h"
#include "pencilscan/capture/v4l2_camera.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/io/file.h"
#include "pencilscan/rig/json_field.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kLabFormat = "lab/1";
constexpr const char* kAravis = "aravis:";
constexpr const char* kVideo = "v4l2:";

/// The folder of a camera that is one.
std::optional<fs::path> folder_of(const LabCamera& camera) {
  if (!camera.device.starts_with(kFolderDevice)) return std::nullopt;
  return camera.device.substr(std::string(kFolderDevice).size());
}

/// The same device as the lab.json at `path` names it.
std::string device_in(const fs::path& path, const LabCamera& camera) {
  const auto folder = folder_of(camera);
  if (!folder || folder->is_absolute()) return camera.device;
  return kFolderDevice +
         fs::proximate(fs::absolute(*folder), fs::absolute(path).parent_path()).string();
}

LabCamera parse_camera(const JsonField& field, const fs::path& base) {
  field.check_keys({}, {"device", "command", "exposure_ms", "gain", "pixel_format"});
  LabCamera camera;
  if (field.has("device") == field.has("command"))
    field.fail("must have either a \"device\" or a \"command\"");
  if (field.has("command")) {
    for (const JsonField& word : field.at("command").entries())
      camera.command.push_back(word.text());
  } else {
    camera.device = field.at("device").text();
    if (const auto folder = folder_of(camera)) {
      if (folder->empty()) field.at("device").fail("must name the folder: folder:PATH");
      camera.device = kFolderDevice + (base / *folder).string();
    }
  }
  if (field.has("exposure_ms")) {
    camera.exposure_ms = field.at("exposure_ms").positive();
    if (*camera.exposure_ms > kLongestExposureMs)
      field.at("exposure_ms").fail("must be at most " + formatted(kLongestExposureMs, "%.0f"));
  }
  if (field.has("gain")) camera.gain = field.at("gain").number();
  if (field.has("pixel_format")) camera.pixel_format = field.at("pixel_format").text();
  return camera;
}

void parse_trigger(const JsonField& field, Lab& lab) {
  field.check_keys({"kind"}, {"line"});
  const auto trigger = trigger_from_text(field.at("kind").text());
  if (!trigger) field.at("kind").fail("must be \"free\", \"software\", \"wire\" or \"ptp\"");
  lab.trigger = *trigger;
  if (field.has("line")) lab.line = field.at("line").text();
}

}  // namespace

Lab read_lab(const fs::path& path) {
  const nlohmann::json json = read_json(path);
  const JsonField root(path.string(), json);
  root.check_keys({"format", "cameras"},
                  {"trigger", "rate_hz", "patience_s", "max_spread_ms", "projectors"});
  if (root.at("format").text() != kLabFormat)
    root.at("format").fail(std::string("must be \"") + kLabFormat + "\"");
  Lab lab;
  for (const auto& [name, field] : root.at("cameras").members())
    lab.cameras[name] = parse_camera(field, path.parent_path());
  if (root.has("trigger")) parse_trigger(root.at("trigger"), lab);
  if (root.has("rate_hz")) lab.rate_hz = root.at("rate_hz").positive();
  if (root.has("patience_s")) lab.patience_s = root.at("patience_s").positive();
  if (root.has("max_spread_ms")) lab.max_spread_ms = root.at("max_spread_ms").positive();
  if (!root.has("projectors")) return lab;
  for (const auto& [name, field] : root.at("projectors").members()) {
    field.check_keys({}, {"output", "delay_ms"});
    if (field.has("output")) lab.outputs[name] = field.at("output").text();
    if (field.has("delay_ms")) lab.delay_ms[name] = field.at("delay_ms").positive();
  }
  return lab;
}

void write_lab(const Lab& lab, const fs::path& path) {
  Json json;
  json["format"] = kLabFormat;
  json["trigger"] = {{"kind", to_string(lab.trigger)}};
  if (lab.trigger == Trigger::kWire) json["trigger"]["line"] = lab.line;
  json["rate_hz"] = lab.rate_hz;
  if (lab.patience_s != Lab{}.patience_s) json["patience_s"] = lab.patience_s;
  if (lab.max_spread_ms > 0) json["max_spread_ms"] = lab.max_spread_ms;
  json["cameras"] = Json::object();
  for (const auto& [name, camera] : lab.cameras) {
    Json& entry = json["cameras"][name];
    if (camera.command.empty())
      entry["device"] = device_in(path, camera);
    else
      entry["command"] = camera.command;
    if (camera.exposure_ms) entry["exposure_ms"] = *camera.exposure_ms;
    if (camera.gain) entry["gain"] = *camera.gain;
    if (camera.pixel_format) entry["pixel_format"] = *camera.pixel_format;
  }
  for (const auto& [name, output] : lab.outputs) json["projectors"][name]["output"] = output;
  for (const auto& [name, delay] : lab.delay_ms) json["projectors"][name]["delay_ms"] = delay;
  write_json(path, json);
}

std::vector<CameraInfo> list_cameras() {
  std::vector<CameraInfo> all = list_aravis_cameras();
  for (CameraInfo& camera : list_v4l2_cameras()) all.push_back(std::move(camera));
  return all;
}

std::pair<std::string, LabCamera> lab_camera_from_text(const std::string& text,
                                                       const std::string& option) {
  const auto sign = text.find('=');
  if (sign == std::string::npos || sign == 0 || sign + 1 == text.size())
    throw InputError("command line", option, text, "must be CAMERA=DEVICE");
  LabCamera camera;
  camera.device = text.substr(sign + 1);
  camera.of_command_line = true;
  return {text.substr(0, sign), camera};
}

std::unique_ptr<CameraDevice> open_camera(const LabCamera& camera) {
  if (!camera.command.empty()) return open_command_camera(camera.command);
  const auto rest = [&](const std::string& start) { return camera.device.substr(start.size()); };
  if (camera.device.starts_with(kAravis)) return open_aravis_camera(rest(kAravis));
  if (camera.device.starts_with(kVideo)) return open_v4l2_camera(rest(kVideo));
  const auto folder = folder_of(camera);
  if (folder && !folder->empty()) return open_folder_camera(*folder);
  throw InputError("camera", "device", camera.device,
                   "must begin with aravis:, v4l2: or folder: (pencilscan capture --list)");
}

namespace {

/// What is wrong with the device of a camera, where it is stated.
InputError fault_of(const std::string& name, const LabCamera& camera, const std::string& source,
                    const std::string& rule) {
  if (camera.of_command_line) return {"command line", "--camera", name + "=" + camera.device, rule};
  if (!camera.command.empty())
    return {source, "cameras." + name + ".command", camera.command.front(), rule};
  return {source, "cameras." + name + ".device", camera.device, rule};
}

/// The same for every way to write it.
std::string device_key(const LabCamera& camera) {
  const auto folder = folder_of(camera);
  std::error_code ignored;
  return folder ? kFolderDevice + fs::weakly_canonical(*folder, ignored).string() : camera.device;
}

/// InputError where a device is that of two cameras.
void check_devices_differ(const Lab& lab, const std::string& source) {
  std::map<std::string, std::string> owners;
  for (const auto& [name, camera] : lab.cameras) {
    if (camera.device.empty()) continue;
    const auto [owner, fresh] = owners.emplace(device_key(camera), name);
    if (!fresh)
      throw fault_of(name, camera, source,
                     "is the device of " + owner->second + ", too: every camera has its own");
  }
}

NamedCamera open_named(const std::string& name, const LabCamera& camera,
                       const std::string& source) {
  try {
    return {name, open_camera(camera)};
  } catch (const InputError& error) {
    throw fault_of(name, camera, source, error.rule);
  } catch (const StageError& error) {
    throw StageError(name + ": " + error.what());
  }
}

}  // namespace

CameraSettings settings_for(const Lab& lab, const Camera& camera) {
  CameraSettings settings;
  settings.width = camera.width;
  settings.height = camera.height;
  settings.trigger = lab.trigger;
  settings.line = lab.line;
  settings.rate_hz = lab.rate_hz;
  const auto found = lab.cameras.find(camera.name);
  if (found == lab.cameras.end()) return settings;
  if (found->second.exposure_ms) settings.exposure_us = 1000 * *found->second.exposure_ms;
  settings.gain = found->second.gain;
  settings.pixel_format = found->second.pixel_format;
  return settings;
}

std::vector<NamedCamera> open_lab_cameras(const Lab& lab, const Rig& rig,
                                          const std::string& source) {
  for (const auto& [name, camera] : lab.cameras)
    if (std::none_of(rig.cameras.begin(), rig.cameras.end(),
                     [&](const Camera& c) { return c.name == name; }))
      throw InputError(source, "cameras." + name, "", "the rig has no camera of this name");
  for (const Camera& camera : rig.cameras)
    if (!lab.cameras.contains(camera.name))
      throw InputError(source, "cameras." + camera.name, "",
                       "this key is missing: which device is it? (or give --camera " + camera.name +
                           "=DEVICE; pencilscan capture --list)");
  check_devices_differ(lab, source);
  const bool network = std::any_of(lab.cameras.begin(), lab.cameras.end(), [](const auto& entry) {
    return entry.second.device.starts_with(kAravis);
  });
  if (network) (void)list_aravis_cameras();  // finds them all at once
  std::vector<NamedCamera> cameras;
  for (const Camera& camera : rig.cameras)
    cameras.push_back(open_named(camera.name, lab.cameras.at(camera.name), source));
  return cameras;
}

double spread_limit_ms(const Lab& lab) {
  if (lab.max_spread_ms > 0) return lab.max_spread_ms;
  double longest = 0;
  for (const auto& [name, camera] : lab.cameras)
    longest = std::max(longest, camera.exposure_ms.value_or(0));
  return longest / 4;
}

}  // namespace pencilscan
