#include "pencilscan/cli/lab_devices.h"

#include "pencilscan/capture/camera_picture.h"
#include "pencilscan/core/error.h"
#include "pencilscan/display/x_screen.h"

namespace pencilscan::cli {

std::unique_ptr<ProjectorScreen> open_lab_screen(const Rig& rig, const Lab& lab,
                                                 const std::string& rig_source,
                                                 const std::string& lab_source) {
  const auto outputs = XScreen().outputs();
  std::vector<Projector> projectors;
  for (const OutputUse& use : uses_of(rig, outputs, lab.outputs, rig_source, lab_source)) {
    projectors.push_back(*use.projector);
    projectors.back().output = use.output->name;
  }
  return open_screen(std::move(projectors));
}

std::unique_ptr<LiveCameras> start_lab_cameras(const Rig& rig, Lab& lab,
                                               const std::string& source) {
  auto cameras = std::make_unique<LiveCameras>(open_lab_cameras(lab, rig, source));
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    try {
      cameras->group().configure(c, settings_for(lab, rig.cameras[c]));
    } catch (const InputError& error) {  // of the device, which knows neither its name nor the file
      throw InputError(source, "cameras." + rig.cameras[c].name + ": " + error.field, error.value,
                       error.rule);
    }
    const CameraSettings made = cameras->group().settings(c);
    check_mosaic(rig.cameras[c], made, source);
    const auto exposure = made.exposure_us;
    LabCamera& camera = lab.cameras[rig.cameras[c].name];
    if (exposure && !camera.exposure_ms) camera.exposure_ms = *exposure / 1000;
  }
  cameras->start();
  return cameras;
}

GrayCaptureOptions gray_options(const Rig& rig, const Lab& lab) {
  GrayCaptureOptions options;
  options.patience_s = lab.patience_s;
  for (const Projector& projector : rig.projectors) {
    const auto delay = lab.delay_ms.find(projector.name);
    options.delay_ms.push_back(delay == lab.delay_ms.end() ? 0 : delay->second);
  }
  return options;
}

ProjectorTestOptions test_options(const Lab& lab) {
  ProjectorTestOptions options;
  options.patience_s = lab.patience_s;
  return options;
}

RecordOptions record_options(const Lab& lab, bool still) {
  RecordOptions options;
  options.rate_hz = lab.rate_hz;
  options.max_spread_ms = still ? 0 : spread_limit_ms(lab);
  options.still_s = still ? lab.patience_s : 0;
  options.one_clock = lab.trigger == Trigger::kPtp;
  options.one_trigger = lab.trigger == Trigger::kWire;
  options.software_trigger = lab.trigger == Trigger::kSoftware;
  return options;
}

}  // namespace pencilscan::cli
