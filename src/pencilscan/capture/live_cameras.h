#pragma once

#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "pencilscan/capture/camera_group.h"
#include "pencilscan/capture/clock_fit.h"

namespace pencilscan {

/// A whole picture with its time.
struct TimedFrame {
  std::shared_ptr<const CameraFrame> frame;
  std::int64_t time_ns = 0;  ///< soonest arrival by the host's clock (ClockFit)
};

/// Cameras that run all the time, for several who look at their pictures: previews, tests,
/// captures and recordings.
class LiveCameras {
 public:
  explicit LiveCameras(std::vector<NamedCamera> cameras) : group_(std::move(cameras)) {}
  ~LiveCameras() { stop(); }
  LiveCameras(const LiveCameras&) = delete;
  LiveCameras& operator=(const LiveCameras&) = delete;

  [[nodiscard]] CameraGroup& group() { return group_; }
  [[nodiscard]] const CameraGroup& group() const { return group_; }
  void start();
  void stop();

  /// The last whole picture of a camera; its frame is null before the first.
  [[nodiscard]] TimedFrame latest(std::size_t camera) const;
  /// The first whole picture of every camera whose time is not before `since_ns`, waited for until
  /// host_now_ns() is `until_ns`; frames are null where none came.
  [[nodiscard]] std::vector<TimedFrame> first_since(std::int64_t since_ns, std::int64_t until_ns);
  /// Triggers all cameras by software and waits so long for the picture of each; frames are null
  /// where none came. Pictures are told by their arrival: the clocks of cameras that take pictures
  /// now and then only, on a busy computer, are not known well enough.
  [[nodiscard]] std::vector<TimedFrame> trigger(double patience_s);
  /// Whole and incomplete pictures of a camera so far.
  struct Count {
    std::size_t whole = 0;
    std::size_t incomplete = 0;
    std::string trouble;  ///< trouble_of() the last picture
    double rate_hz = 0;   ///< of the last pictures; 0: unknown
  };
  [[nodiscard]] Count count(std::size_t camera) const;
  [[nodiscard]] std::vector<ClockFit> clocks() const;

  /// Pictures of all cameras taken at that time or later, waited for so long from then on: as they
  /// come, or triggered then where the cameras are set to software triggers.
  [[nodiscard]] std::vector<TimedFrame> taken_since(std::int64_t since_ns, double patience_s);

  /// While it lives, `sink` gets every picture, from the cameras' threads.
  class Listener {
   public:
    Listener(LiveCameras& cameras, CameraGroup::Sink sink);
    ~Listener();
    Listener(const Listener&) = delete;
    Listener& operator=(const Listener&) = delete;

   private:
    LiveCameras& cameras_;
    std::size_t id_;
  };

 private:
  struct Seen {
    ClockFit clock;
    std::deque<TimedFrame> last;  ///< some whole pictures, oldest first
    Count count;
    std::deque<std::int64_t> arrivals;
  };
  void take(std::size_t camera, CameraFrame frame);
  /// The first whole picture of every camera that `is_meant`, waited for as in first_since().
  template <class IsMeant>
  [[nodiscard]] std::vector<TimedFrame> first_that(IsMeant is_meant, std::int64_t until_ns);

  CameraGroup group_;
  mutable std::mutex mutex_;
  std::condition_variable arrived_;
  std::vector<Seen> seen_;
  std::mutex listeners_mutex_;
  std::map<std::size_t, CameraGroup::Sink> listeners_;
  std::size_t next_listener_ = 0;
};

}  // namespace pencilscan
