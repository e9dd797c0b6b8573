#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "pencilscan/capture/lab_file.h"
#include "pencilscan/server/lab_server.h"

namespace pencilscan::cli {

class Interruption;

/// What the page of a laboratory works on.
struct LabDeskOptions {
  std::filesystem::path rig;  ///< devices, calibrated or not
  Lab lab;
  std::string lab_source;                   ///< for messages
  std::filesystem::path out;                ///< poses, rig.json, frames, logs
  std::vector<std::string> known_distance;  ///< cam0 cam1 850; empty: the rig has no scale
  int threads = 0;
  /// Of a virtual laboratory: somebody puts other things there, for the next pose (from 1), or the
  /// object for a frame (0).
  std::function<void(int pose)> arrange;
};

/// Opens the devices of a laboratory, prints the page's link, and serves it until interrupted. The
/// page has previews and figures of all cameras, pictures on the projectors, and one piece of work
/// at a time on a thread of its own: flashes, captures of poses with the calibration after each,
/// frames with what was named in them. Devices are put back as they were when it ends.
void serve_lab(LabDeskOptions options, LabServer& server, Interruption& interruption);

}  // namespace pencilscan::cli
