#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "pencilscan/capture/camera_device.h"
#include "pencilscan/core/fault.h"

namespace pencilscan {

/// A camera of the rig that was opened.
struct NamedCamera {
  std::string name;
  std::unique_ptr<CameraDevice> device;
};

/// All cameras at once: a thread each, which is the only one that touches its camera while they
/// run.
class CameraGroup {
 public:
  explicit CameraGroup(std::vector<NamedCamera> cameras);
  /// Stops, and closes the cameras: their settings are put back.
  ~CameraGroup();
  CameraGroup(const CameraGroup&) = delete;
  CameraGroup& operator=(const CameraGroup&) = delete;

  [[nodiscard]] std::size_t size() const;
  [[nodiscard]] const std::string& name(std::size_t camera) const;
  [[nodiscard]] const CameraInfo& info(std::size_t camera) const;
  /// What configure() made of the settings.
  [[nodiscard]] CameraSettings settings(std::size_t camera) const;
  /// Stops this camera for it where it runs, and starts it again. InputError as of
  /// CameraDevice::configure().
  void configure(std::size_t camera, const CameraSettings& settings);

  /// Called from the camera's own thread with every picture, whole or not.
  using Sink = std::function<void(std::size_t camera, CameraFrame frame)>;
  void start(Sink sink);
  void stop();
  [[nodiscard]] bool running() const;
  /// Asks all cameras for a picture now (software trigger), each from its own thread.
  void trigger();

  /// Cameras that cannot be reached ("dead"), that fail to start or to be triggered ("trouble").
  [[nodiscard]] std::vector<Fault> faults() const;

 private:
  struct Member;
  std::vector<std::unique_ptr<Member>> members_;
  Sink sink_;
  bool running_ = false;
};

}  // namespace pencilscan
