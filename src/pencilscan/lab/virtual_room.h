#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <mutex>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "pencilscan/lab/light_history.h"
#include "pencilscan/rig/rig.h"
#include "pencilscan/simulation/light_transport.h"
#include "pencilscan/simulation/photography.h"

namespace pencilscan {

/// Exposure at which the light is that of RenderOptions::exposure, ms: one period at 60 Hz.
inline constexpr double kRoomExposureMs = 1000.0 / 60;

/// The room of the virtual laboratory: an object, projectors that shine what their outputs show,
/// and what the cameras see of it. Any thread.
class VirtualRoom {
 public:
  /// `rig`: the true one. The room has no object yet: cameras see nothing. Of `photo`, lines come
  /// from outputs; its black level counts (0.004 where it states none), its film not.
  VirtualRoom(Rig rig, const PhotographyOptions& photo);

  [[nodiscard]] const Rig& rig() const { return rig_; }
  /// Puts the object there, in the place of another. Takes its time: all rays are traced.
  void place(const SimulatedObject& object);
  /// Output number `output` shows this picture (CV_8UC3, RGB; empty: no signal) since time_ns. A
  /// projector scales what is not of its panel's size.
  void show(std::size_t output, std::int64_t time_ns, const cv::Mat& picture);
  /// What the camera stores of an exposure that began then: 8U, RGB, or one channel where `mosaic`
  /// is stated. `gain`: factor.
  [[nodiscard]] cv::Mat expose(std::size_t camera, std::int64_t begin_ns, double exposure_us,
                               double gain, const std::optional<Mosaic>& mosaic);

  // What goes wrong in laboratories, made on purpose.
  /// Light of this projector comes so late.
  void set_delay(std::size_t projector, double ms);
  /// The cables of two projectors are exchanged.
  void swap_cables(std::size_t a, std::size_t b);
  /// The projector enlarges its picture about its middle, as "overscan" does.
  void set_zoom(std::size_t projector, double factor);

 private:
  /// What all cameras see of one object.
  struct Scene {
    std::vector<LightTransport> views;  ///< per camera
  };
  struct Lamp {
    LightHistory history;
    std::int64_t delay_ns = 0;
    double zoom = 1;
    std::size_t output = 0;
  };
  /// What a picture of a projector adds to a camera's: of the two last ones.
  struct Addition {
    LightHistory::Picture picture;
    cv::Mat light;
  };
  struct Eye {
    std::mutex mutex;
    std::shared_ptr<const Scene> scene;                 ///< that the additions belong to
    std::vector<std::array<Addition, 2>> by_projector;  ///< the last one first
    std::uint32_t pictures = 0;
  };
  [[nodiscard]] const cv::Mat& addition(Eye& eye, std::size_t camera, std::size_t projector,
                                        const LightHistory::Picture& picture) const;

  Rig rig_;
  PhotographyOptions photo_;
  double black_level_;
  mutable std::mutex mutex_;  ///< of what follows
  std::shared_ptr<const Scene> scene_;
  std::vector<Lamp> lamps_;
  std::vector<cv::Mat> shown_;  ///< per output, the last picture
  std::vector<std::unique_ptr<Eye>> eyes_;
};

}  // namespace pencilscan
