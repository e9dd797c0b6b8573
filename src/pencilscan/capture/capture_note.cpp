#include "pencilscan/capture/capture_note.h"

#include <algorithm>
#include <climits>
#include <nlohmann/json.hpp>

#include "pencilscan/io/file.h"
#include "pencilscan/rig/json_field.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kFile = "capture.json";
constexpr const char* kNoteFormat = "capture/1";

/// `rule` ends the sentence "must ...".
[[noreturn]] void refuse(const JsonField& field, const std::string& rule) {
  std::string text = "must ";
  text += rule;
  text += "; take it into another folder, or remove this one";
  field.fail(text);
}

void expect_integer(const JsonField& field, int wanted) {
  if (field.integer(0, INT_MAX) != wanted)
    refuse(field, "be " + std::to_string(wanted) + ", as this capture is taken");
}

void expect_flag(const nlohmann::json& json, const JsonField& root, const char* key, bool wanted) {
  if (json.at(key) != nlohmann::json(wanted))
    refuse(root.at(key),
           wanted ? "be true, as this capture is taken" : "be false, as this capture is taken");
}

void expect_size(const JsonField& field, int width, int height) {
  expect_integer(field.at("width"), width);
  expect_integer(field.at("height"), height);
}

}  // namespace

CaptureNote capture_note(const Projector& projector, const std::vector<Camera>& all, bool inverses,
                         bool solids) {
  CaptureNote note{projector.name, projector.width, projector.height, inverses, solids, {}};
  for (const Camera& camera : all)
    note.cameras.push_back({camera.name, camera.width, camera.height});
  return note;
}

void write_capture_note(const fs::path& folder, const CaptureNote& note) {
  Json json;
  json["format"] = kNoteFormat;
  json["projector"] = {{"name", note.projector}, {"width", note.width}, {"height", note.height}};
  json["inverses"] = note.inverses;
  json["solids"] = note.solids;
  json["cameras"] = Json::object();
  for (const CaptureNote::CameraSize& camera : note.cameras)
    json["cameras"][camera.name] = {{"width", camera.width}, {"height", camera.height}};
  write_json(folder / kFile, json);
}

bool has_capture_note(const fs::path& folder) { return fs::exists(folder / kFile); }

void check_capture_note(const fs::path& folder, const CaptureNote& wanted) {
  if (!has_capture_note(folder)) return;
  const fs::path path = folder / kFile;
  const nlohmann::json json = read_json(path);
  const JsonField root(path.string(), json);
  root.check_keys({"format", "projector", "inverses", "solids", "cameras"}, {});
  if (root.at("format").text() != kNoteFormat)
    root.at("format").fail(std::string("must be \"") + kNoteFormat + "\"");
  if (root.at("projector").at("name").text() != wanted.projector)
    refuse(root.at("projector").at("name"), "be " + wanted.projector);
  expect_size(root.at("projector"), wanted.width, wanted.height);
  expect_flag(json, root, "inverses", wanted.inverses);
  expect_flag(json, root, "solids", wanted.solids);
  const auto there = root.at("cameras").members();
  for (const auto& [name, field] : there) {
    const auto camera = std::find_if(wanted.cameras.begin(), wanted.cameras.end(),
                                     [&](const auto& c) { return c.name == name; });
    if (camera == wanted.cameras.end()) refuse(field, "be a camera of this capture");
    expect_size(field, camera->width, camera->height);
  }
  for (const CaptureNote::CameraSize& camera : wanted.cameras)
    if (std::none_of(there.begin(), there.end(),
                     [&](const auto& entry) { return entry.first == camera.name; }))
      refuse(root.at("cameras"), "have " + camera.name + ", which this capture has");
}

}  // namespace pencilscan
