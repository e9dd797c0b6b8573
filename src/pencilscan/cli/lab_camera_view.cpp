#include "pencilscan/cli/lab_camera_view.h"

#include <nlohmann/json.hpp>

namespace pencilscan::cli {

LabCameraView::LabCameraView(const Rig& rig, LiveCameras& cameras)
    : rig_(rig), cameras_(cameras), figured_(rig.cameras.size()) {}

LiveFigures LabCameraView::figures_of(std::size_t camera, const TimedFrame& latest) {
  const std::lock_guard lock(mutex_);
  Figured& known = figured_[camera];
  if (latest.frame && known.time_ns != latest.time_ns)
    known = {latest.time_ns, live_figures(*latest.frame, rig_.cameras[camera].black_level)};
  return known.figures;
}

nlohmann::ordered_json LabCameraView::status(std::size_t camera, const std::string& showing) {
  const TimedFrame latest = cameras_.latest(camera);
  const LiveFigures figures = figures_of(camera, latest);
  const LiveCameras::Count count = cameras_.count(camera);
  const CameraSettings settings = cameras_.group().settings(camera);
  const std::string& name = rig_.cameras[camera].name;
  std::vector<std::string> advice;
  for (const Fault& fault : cameras_.group().faults())
    if (fault.device == name) advice.push_back(fault.what);
  if (!count.trouble.empty()) advice.push_back(count.trouble);
  if (latest.frame && showing != "black")
    for (std::string& line : advice_for(figures, showing.starts_with("lines")))
      advice.push_back(std::move(line));
  return {{"name", name},
          {"address", cameras_.group().info(camera).address},
          {"whole", count.whole},
          {"incomplete", count.incomplete},
          {"rate_hz", count.rate_hz},
          {"exposure_ms", settings.exposure_us.value_or(0) / 1000},
          {"gain", settings.gain.value_or(0)},
          {"figures",
           {{"brightest", figures.brightest},
            {"saturated", figures.saturated},
            {"lit", figures.lit},
            {"edge_px", figures.edge_px},
            {"line_contrast", figures.line_contrast}}},
          {"advice", advice}};
}

std::string LabCameraView::preview(std::size_t camera) const {
  constexpr int kPreviewWidth = 640;  // px
  if (camera >= rig_.cameras.size()) return "";
  const TimedFrame latest = cameras_.latest(camera);
  if (!latest.frame) return "";
  return preview_jpeg(*latest.frame, kPreviewWidth);
}

}  // namespace pencilscan::cli
