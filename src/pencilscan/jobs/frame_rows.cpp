#include "pencilscan/jobs/frame_rows.h"

#include <cmath>
#include <cstdlib>
#include <functional>
#include <nlohmann/json.hpp>
#include <utility>

#include "pencilscan/core/error.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/io/file.h"
#include "pencilscan/jobs/device_light.h"
#include "pencilscan/refinement/crossing_tracks.h"
#include "pencilscan/report/labelled_share.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

double figure(const json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_number() ? found->get<double>() : kUnknownFigure;
}

/// The entry of a list of objects that has this name; null where there is none.
const json& named_entry(const json& object, const char* list, const std::string& name) {
  static const json none = json::object();
  const auto found = object.find(list);
  if (found == object.end() || !found->is_array()) return none;
  for (const json& entry : *found) {
    if (entry.is_object() && entry.value("name", "") == name) return entry;
  }
  return none;
}

/// How far a device's crossings miss each other; unknown where they are too few.
void add_device_crossing(const json& crossings, const std::string& name, FrameRow& row) {
  const json& entry = named_entry(crossings, "devices", name);
  CrossingDisagreement of_device;
  of_device.crossings = entry.value("crossings", std::size_t{0});
  const bool is_known = are_enough(of_device);
  row.device_crossing_px.push_back(is_known ? figure(entry, "median_px") : kUnknownFigure);
  row.device_crossing_expected_px.push_back(is_known ? figure(entry, "expected_px")
                                                     : kUnknownFigure);
}

double share(double part, double whole) { return whole > 0 ? part / whole : kUnknownFigure; }

CameraRow camera_row(const json& entry, const std::vector<std::string>& projectors) {
  CameraRow row;
  row.labelled_points = figure(entry, "labelled_curve_points");
  row.labelled_share = share(row.labelled_points, figure(entry, "curve_points"));
  row.line_width_px = figure(entry, "curve_width_median_px");
  row.line_height = figure(entry, "curve_height_median");
  const json heights = entry.value("curve_height_by_projector", json::object());
  for (const std::string& name : projectors)
    row.height_of_projector.push_back(figure(heights, name.c_str()));
  row.image_level = figure(entry, "image_level");
  row.saturated_pixels = figure(entry, "saturated_pixels");
  row.time_offset_us = figure(entry, "time_offset_us");
  row.is_late = entry.value("late", json(false)) == true;
  const json picture = entry.value("picture", json());
  if (picture.is_string())
    row.picture = std::strtoull(picture.get<std::string>().c_str(), nullptr, 16);
  return row;
}

double median_of_known(const std::vector<CameraRow>& cameras,
                       const std::function<double(const CameraRow&)>& reading) {
  std::vector<double> known;
  for (const CameraRow& camera : cameras) {
    const double value = reading(camera);
    if (std::isfinite(value)) known.push_back(value);
  }
  return known.empty() ? kUnknownFigure : upper_median(std::move(known));
}

void read_report(const json& report, const SequenceDevices& devices, FrameRow& row) {
  row.points = figure(report, "points");
  row.time_spread_us = figure(report, "time_spread_us");
  const json crossings = report.value("crossing_disagreement", json::object());
  row.crossing_px = figure(crossings, "median_px");
  row.crossing_expected_px = figure(crossings, "expected_px");
  const json motion = report.value("motion", json::object());
  if (motion.contains("seen"))
    row.motion_mm = motion.value("seen", false) ? figure(motion, "way_mm") : 0;
  const json surface = report.value("surface", json::object());
  if (figure(surface, "vertices") > 0) row.measured_share = figure(surface, "measured_share");
  double saturated = 0;
  for (const std::string& name : devices.cameras) {
    const json& entry = named_entry(report, "cameras", name);
    row.cameras.push_back(camera_row(entry, devices.projectors));
    const json shift = named_entry(crossings, "devices", name).value("shift_px", json());
    if (shift.is_array() && shift.size() == 2 && shift[0].is_number() && shift[1].is_number()) {
      row.cameras.back().shift_x_px = shift[0].get<double>();
      row.cameras.back().shift_y_px = shift[1].get<double>();
    }
    const double pixels = figure(entry, "saturated_pixels");
    if (std::isfinite(pixels)) saturated += pixels;
    add_device_crossing(crossings, name, row);
  }
  const json by_projector = report.value("points_by_projector", json::object());
  for (std::size_t p = 0; p < devices.projectors.size(); ++p) {
    const std::string& name = devices.projectors[p];
    row.projector_points.push_back(figure(by_projector, name.c_str()));
    row.projector_height.push_back(median_of_known(
        row.cameras, [p](const CameraRow& camera) { return camera.height_of_projector[p]; }));
    add_device_crossing(crossings, name, row);
  }
  row.labelled_share = labelled_share(report).value_or(kUnknownFigure);
  row.saturated_pixels = saturated;
  row.line_width_px = median_of_known(row.cameras, std::mem_fn(&CameraRow::line_width_px));
  row.line_height = median_of_known(row.cameras, std::mem_fn(&CameraRow::line_height));
  for (const json& warning : report.value("warnings", json::array()))
    row.warnings.push_back(warning.get<std::string>());
  for (const json& finding : report.value("findings", json::array())) {
    row.findings.push_back(
        {finding.value("code", ""), finding.value("device", ""), finding.value("text", "")});
  }
}

/// The report's figures; a frame whose report cannot be read is as good as failed.
void read_row(const fs::path& file, const SequenceDevices& devices, FrameRow& row) {
  FrameRow found = row;
  try {
    read_report(read_json(file), devices, found);
    row = std::move(found);
  } catch (const std::exception& error) {
    row.status.state = FrameState::kFailed;
    row.status.failure = {std::string("its report cannot be read; remove the frame's folder and "
                                      "run reconstruct again: ") +
                              error.what(),
                          false};
  }
}

}  // namespace

std::vector<FrameRow> read_frame_rows(const fs::path& out, const RunInputs& inputs,
                                      const SequenceDevices& devices) {
  std::vector<FrameRow> rows(inputs.frames.size());
  const std::string settings = inputs.settings();
  parallel_for(rows.size(), [&](std::size_t i) {
    FrameRow& row = rows[i];
    row.name = inputs.frames[i];
    row.status = frame_status(out, row.name, settings, std::nullopt);
    if (row.status.state == FrameState::kDone)
      read_row(out / row.name / "report.json", devices, row);
    row.cameras.resize(devices.cameras.size());
    row.device_crossing_px.resize(devices.cameras.size() + devices.projectors.size(),
                                  kUnknownFigure);
    row.device_crossing_expected_px.resize(row.device_crossing_px.size(), kUnknownFigure);
    row.projector_points.resize(devices.projectors.size(), kUnknownFigure);
    row.projector_height.resize(devices.projectors.size(), kUnknownFigure);
  });
  find_device_light(rows, devices);
  return rows;
}

}  // namespace pencilscan
