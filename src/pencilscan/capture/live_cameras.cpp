#include "pencilscan/capture/live_cameras.h"

#include <algorithm>
#include <chrono>
#include <thread>

#include "pencilscan/core/host_clock.h"

namespace pencilscan {
namespace {

/// Pictures kept of each camera: some who wait may look late.
constexpr std::size_t kKept = 4;
constexpr std::size_t kRatePictures = 10;

}  // namespace

void LiveCameras::start() {
  {
    const std::lock_guard lock(mutex_);
    seen_.assign(group_.size(), {});
  }
  group_.start([this](std::size_t camera, CameraFrame frame) { take(camera, std::move(frame)); });
}

void LiveCameras::stop() { group_.stop(); }

void LiveCameras::take(std::size_t camera, CameraFrame frame) {
  {
    const std::lock_guard lock(listeners_mutex_);
    for (const auto& [id, sink] : listeners_) sink(camera, frame);
  }
  {
    const std::lock_guard lock(mutex_);
    Seen& seen = seen_[camera];
    seen.arrivals.push_back(frame.arrival_ns);
    if (seen.arrivals.size() > kRatePictures) seen.arrivals.pop_front();
    const auto span = static_cast<double>(seen.arrivals.back() - seen.arrivals.front());
    seen.count.rate_hz = span > 0 ? 1e9 * static_cast<double>(seen.arrivals.size() - 1) / span : 0;
    seen.count.trouble = trouble_of(frame);
    if (frame.status != PictureStatus::kComplete) {
      ++seen.count.incomplete;
      return;
    }
    ++seen.count.whole;
    TimedFrame timed;
    timed.time_ns = frame.arrival_ns;
    if (frame.timestamp_ns >= 0) {
      seen.clock.add(frame.timestamp_ns, frame.arrival_ns);
      timed.time_ns = seen.clock.host_from_camera(frame.timestamp_ns);
    }
    timed.frame = std::make_shared<const CameraFrame>(std::move(frame));
    seen.last.push_back(std::move(timed));
    if (seen.last.size() > kKept) seen.last.pop_front();
  }
  arrived_.notify_all();
}

TimedFrame LiveCameras::latest(std::size_t camera) const {
  const std::lock_guard lock(mutex_);
  if (camera >= seen_.size() || seen_[camera].last.empty()) return {};
  return seen_[camera].last.back();
}

LiveCameras::Count LiveCameras::count(std::size_t camera) const {
  const std::lock_guard lock(mutex_);
  return camera < seen_.size() ? seen_[camera].count : Count{};
}

std::vector<ClockFit> LiveCameras::clocks() const {
  const std::lock_guard lock(mutex_);
  std::vector<ClockFit> clocks;
  for (const Seen& seen : seen_) clocks.push_back(seen.clock);
  return clocks;
}

template <class IsMeant>
std::vector<TimedFrame> LiveCameras::first_that(IsMeant is_meant, std::int64_t until_ns) {
  std::vector<TimedFrame> found(group_.size());
  std::unique_lock lock(mutex_);
  for (;;) {
    bool all = true;
    for (std::size_t c = 0; c < seen_.size(); ++c) {
      if (found[c].frame) continue;
      for (const TimedFrame& timed : seen_[c].last) {
        if (!is_meant(timed)) continue;
        found[c] = timed;
        break;
      }
      all = all && found[c].frame;
    }
    const std::int64_t left = until_ns - host_now_ns();
    if (all || left <= 0) return found;
    arrived_.wait_for(lock, std::chrono::nanoseconds(left));
  }
}

std::vector<TimedFrame> LiveCameras::first_since(std::int64_t since_ns, std::int64_t until_ns) {
  return first_that([&](const TimedFrame& timed) { return timed.time_ns >= since_ns; }, until_ns);
}

std::vector<TimedFrame> LiveCameras::trigger(double patience_s) {
  const std::int64_t since = host_now_ns();
  group_.trigger();
  return first_that([&](const TimedFrame& timed) { return timed.frame->arrival_ns >= since; },
                    since + static_cast<std::int64_t>(1e9 * patience_s));
}

std::vector<TimedFrame> LiveCameras::taken_since(std::int64_t since_ns, double patience_s) {
  if (group_.size() == 0 || group_.settings(0).trigger != Trigger::kSoftware)
    return first_since(since_ns, since_ns + static_cast<std::int64_t>(1e9 * patience_s));
  std::this_thread::sleep_for(
      std::chrono::nanoseconds(std::max<std::int64_t>(0, since_ns - host_now_ns())));
  return trigger(patience_s);
}

LiveCameras::Listener::Listener(LiveCameras& cameras, CameraGroup::Sink sink) : cameras_(cameras) {
  const std::lock_guard lock(cameras_.listeners_mutex_);
  id_ = cameras_.next_listener_++;
  cameras_.listeners_[id_] = std::move(sink);
}

LiveCameras::Listener::~Listener() {
  const std::lock_guard lock(cameras_.listeners_mutex_);
  cameras_.listeners_.erase(id_);
}

}  // namespace pencilscan
