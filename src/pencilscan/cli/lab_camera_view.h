#pragma once

#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "pencilscan/capture/live_cameras.h"
#include "pencilscan/capture/live_figures.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan::cli {

/// What the page of a laboratory shows of each camera. Any number of threads may ask.
class LabCameraView {
 public:
  /// Keeps references to both; `cameras`: those of the rig, in its order.
  LabCameraView(const Rig& rig, LiveCameras& cameras);

  /// Name, counts, settings, and figures of the last picture with advice on them; `showing`: what
  /// the projectors show, begins as to_string(ProjectorPicture). JSON of the page (docs/lab.md).
  [[nodiscard]] nlohmann::ordered_json status(std::size_t camera, const std::string& showing);
  /// The last picture as a small JPEG; empty where there is none, or no such camera.
  [[nodiscard]] std::string preview(std::size_t camera) const;

 private:
  /// The figures of a picture that was looked at already.
  struct Figured {
    std::int64_t time_ns = -1;
    LiveFigures figures;
  };

  [[nodiscard]] LiveFigures figures_of(std::size_t camera, const TimedFrame& latest);

  const Rig& rig_;
  LiveCameras& cameras_;
  std::mutex mutex_;  ///< of what follows
  std::vector<Figured> figured_;
};

}  // namespace pencilscan::cli
