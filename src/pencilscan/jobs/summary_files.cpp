#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "pencilscan/core/formatted.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/io/file.h"
#include "pencilscan/jobs/finish.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

using Columns = std::vector<std::pair<std::string, double>>;

/// Six digits, so that files stay readable; empty when unknown.
std::string six_figures(double value) {
  return std::isfinite(value) ? formatted(value, "%.6g") : std::string();
}

ordered_json json_figure(double value) {
  if (!std::isfinite(value)) return nullptr;
  return std::stod(six_figures(value));
}

const char* word_of(FrameState state) {
  switch (state) {
    case FrameState::kMissing:
      return "missing";
    case FrameState::kDone:
      return "done";
    case FrameState::kFailed:
      return "failed";
    case FrameState::kOther:
      return "other";
  }
  return "";
}

/// The figures of a frame under the names of their columns.
Columns columns_of(const FrameRow& row, const SequenceDevices& devices) {
  Columns columns = {{"points", row.points},
                     {"labelled_share", row.labelled_share},
                     {"crossing_px", row.crossing_px},
                     {"crossing_expected_px", row.crossing_expected_px},
                     {"measured_share", row.measured_share},
                     {"line_width_px", row.line_width_px},
                     {"line_height", row.line_height},
                     {"saturated_pixels", row.saturated_pixels},
                     {"time_spread_us", row.time_spread_us},
                     {"motion_mm", row.motion_mm}};
  const std::size_t cameras = devices.cameras.size();
  for (std::size_t c = 0; c < cameras; ++c) {
    const CameraRow& camera = row.cameras[c];
    const std::string prefix = devices.cameras[c] + ".";
    columns.insert(columns.end(), {{prefix + "labelled_share", camera.labelled_share},
                                   {prefix + "crossing_px", row.device_crossing_px[c]},
                                   {prefix + "shift_x_px", camera.shift_x_px},
                                   {prefix + "shift_y_px", camera.shift_y_px},
                                   {prefix + "line_width_px", camera.line_width_px},
                                   {prefix + "line_height", camera.line_height},
                                   {prefix + "image_level", camera.image_level},
                                   {prefix + "saturated_pixels", camera.saturated_pixels},
                                   {prefix + "time_offset_us", camera.time_offset_us}});
  }
  for (std::size_t p = 0; p < devices.projectors.size(); ++p) {
    const std::string prefix = devices.projectors[p] + ".";
    columns.insert(columns.end(), {{prefix + "points", row.projector_points[p]},
                                   {prefix + "line_height", row.projector_height[p]},
                                   {prefix + "crossing_px", row.device_crossing_px[cameras + p]}});
  }
  return columns;
}

std::string joined(const std::vector<std::string>& texts) {
  std::string all;
  for (const std::string& text : texts) add_name(all, text, "; ");
  return all;
}

/// RFC 4180.
std::string csv_word(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string word = "\"";
  for (const char c : text) word += c == '"' ? std::string("\"\"") : std::string(1, c);
  return word + "\"";
}

/// A row that knows nothing, for the names of the columns.
FrameRow empty_row(const SequenceDevices& devices) {
  FrameRow row;
  row.cameras.resize(devices.cameras.size());
  row.projector_points.resize(devices.projectors.size());
  row.projector_height.resize(devices.projectors.size());
  row.device_crossing_px.resize(devices.cameras.size() + devices.projectors.size());
  return row;
}

std::string csv_of(const SequenceSummary& summary) {
  std::string text = "frame,state";
  for (const auto& [name, value] : columns_of(empty_row(summary.devices), summary.devices))
    text += "," + csv_word(name);
  text += ",remarks\n";
  for (const FrameRow& row : summary.rows) {
    text += csv_word(row.name) + "," + word_of(row.status.state);
    for (const auto& [name, value] : columns_of(row, summary.devices))
      text += "," + six_figures(value);
    const std::string remarks =
        row.status.failure ? row.status.failure->reason : joined(row.warnings);
    text += "," + csv_word(remarks) + "\n";
  }
  return text;
}

ordered_json row_json(const FrameRow& row, const SequenceDevices& devices) {
  ordered_json entry = {{"frame", row.name}, {"state", word_of(row.status.state)}};
  if (row.status.state != FrameState::kDone) return entry;
  for (const auto& [name, value] : columns_of(row, devices)) {
    if (std::isfinite(value)) entry[name] = json_figure(value);
  }
  ordered_json late = ordered_json::array();
  for (std::size_t c = 0; c < devices.cameras.size(); ++c) {
    if (row.cameras[c].is_late) late.push_back(devices.cameras[c]);
  }
  if (!late.empty()) entry["late"] = late;
  if (!row.warnings.empty()) entry["warnings"] = row.warnings;
  return entry;
}

ordered_json event_json(const SequenceEvent& event, const std::vector<FrameRow>& rows) {
  ordered_json entry = {{"frame", rows[event.first].name},
                        {"last_frame", rows[event.last].name},
                        {"figure", event.kind}};
  if (!event.device.empty()) entry["device"] = event.device;
  if (std::isfinite(event.before)) entry["before"] = json_figure(event.before);
  if (std::isfinite(event.after)) entry["after"] = json_figure(event.after);
  entry["text"] = event.text;
  return entry;
}

}  // namespace

void write_summary(const fs::path& out, const SequenceSummary& summary) {
  ordered_json object;
  object["format"] = "sequence/1";
  object["frames"] = summary.rows.size();
  object["frames_done"] = summary.done();
  object["cameras"] = summary.devices.cameras;
  object["projectors"] = summary.devices.projectors;
  object["holes"] = ordered_json::array();
  for (const Hole& hole : summary.holes) {
    object["holes"].push_back({{"frame", summary.rows[hole.row].name},
                               {"state", hole.state},
                               {"reason", hole.reason},
                               {"may_fill", hole.may_fill}});
  }
  object["events"] = ordered_json::array();
  for (const SequenceEvent& event : summary.watch.events)
    object["events"].push_back(event_json(event, summary.rows));
  object["not_watched"] = summary.watch.not_watched;
  object["table"] = ordered_json::array();
  for (const FrameRow& row : summary.rows)
    object["table"].push_back(row_json(row, summary.devices));
  write_text(out / "sequence.csv", csv_of(summary));
  write_json(out / "sequence.json", object);
}

}  // namespace pencilscan
