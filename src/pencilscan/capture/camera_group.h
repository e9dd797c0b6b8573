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
  /// How long a camera may take to answer, s: longer than the half minute that a command camera may
  /// take for one picture.
  static constexpr double kLongestAnswer = 40;

  explicit CameraGroup(std::vector<NamedCamera> cameras, double longest_answer_s = kLongestAnswer);
  /// Stops, and closes the cameras: their settings are put back. One that does not answer is left
  /// as it is.
  ~CameraGroup();
  CameraGroup(const CameraGroup&) = delete;
  CameraGroup& operator=(const CameraGroup&) = delete;

  [[nodiscard]] std::size_t size() const;
  [[nodiscard]] const std::string& name(std::size_t camera) const;
  [[nodiscard]] const CameraInfo& info(std::size_t camera) const;
  /// What configure() made of the settings.
  [[nodiscard]] CameraSettings settings(std::size_t camera) const;
  /// Stops this camera for it where it runs, and starts it again, also where it refuses. InputError
  /// as of CameraDevice::configure(); StageError when it does not answer in time.
  void configure(std::size_t camera, const CameraSettings& settings);

  /// Called from the camera's own thread with every picture, whole or not.
  using Sink = std::function<void(std::size_t camera, CameraFrame frame)>;
  void start(Sink sink);
  void stop();
  [[nodiscard]] bool running() const;
  /// Asks all cameras for a picture now (software trigger), each from its own thread.
  void trigger();

  /// Cameras that cannot be reached, or do not answer in time ("dead"), that fail to start or to be
  /// triggered ("trouble").
  [[nodiscard]] std::vector<Fault> faults() const;

 private:
  struct Member;
  /// Shared with the camera's thread: one that does not answer outlives the group.
  std::vector<std::shared_ptr<Member>> members_;
  double longest_answer_s_;
  bool running_ = false;
};

}  // namespace pencilscan
