#include "pencilscan/capture/scripted_camera.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <thread>

#include "pencilscan/core/host_clock.h"

namespace pencilscan {
namespace {

constexpr double kDefaultExposureUs = 10000;
constexpr double kDefaultRate = 25;

class ScriptedCamera final : public CameraDevice {
 public:
  explicit ScriptedCamera(CameraScript script) : script_(std::move(script)) {
    info_ = {"scripted:" + script_.name, "scripted", script_.name};
  }

  const CameraInfo& info() const override { return info_; }

  CameraSettings configure(const CameraSettings& settings) override {
    CameraSettings result = settings;
    result.exposure_us =
        settings.exposure_us.value_or(settings_.exposure_us.value_or(kDefaultExposureUs));
    result.gain = settings.gain.value_or(settings_.gain.value_or(1));
    result.rate_hz = settings.rate_hz.value_or(settings_.rate_hz.value_or(kDefaultRate));
    settings_ = result;
    return result;
  }

  void start() override {
    running_ = true;
    number_ = script_.first_number;
    pulses_.clear();
    const auto period = period_ns();
    const auto phase = static_cast<std::int64_t>(script_.phase_s * 1e9);
    next_ = ((host_now_ns() - phase) / period + 1) * period + phase;
  }
  void stop() override { running_ = false; }
  void trigger() override { pulses_.push_back(host_now_ns()); }

  std::optional<CameraFrame> next(Seconds patience) override {
    if (!running_) return std::nullopt;
    const std::int64_t until = host_now_ns() + static_cast<std::int64_t>(patience.count() * 1e9);
    std::int64_t begin = next_;
    if (settings_.trigger == Trigger::kSoftware) {
      if (pulses_.empty()) {
        wait_until(until);
        return std::nullopt;
      }
      begin = pulses_.front();
    }
    const double exposure_us = settings_.exposure_us.value_or(kDefaultExposureUs);
    const std::int64_t end = begin + static_cast<std::int64_t>(exposure_us * 1e3);
    if (settings_.trigger != Trigger::kSoftware && end > until) {
      wait_until(until);
      return std::nullopt;
    }
    wait_until(end);
    if (settings_.trigger == Trigger::kSoftware)
      pulses_.pop_front();
    else
      next_ = begin + period_ns();
    CameraFrame frame;
    frame.number = number_++;
    frame.timestamp_ns =
        begin + script_.clock_start_ns +
        static_cast<std::int64_t>(1e-6 * script_.clock_ppm * static_cast<double>(begin));
    frame.mosaic = script_.mosaic;
    frame.image = script_.expose(begin, exposure_us, settings_.gain.value_or(1));
    frame.arrival_ns = host_now_ns();
    if (frame.image.empty()) frame.status = PictureStatus::kLostPackets;
    return frame;
  }

 private:
  [[nodiscard]] std::int64_t period_ns() const {
    return static_cast<std::int64_t>(1e9 / settings_.rate_hz.value_or(kDefaultRate));
  }
  static void wait_until(std::int64_t when) {
    std::this_thread::sleep_for(
        std::chrono::nanoseconds(std::max<std::int64_t>(0, when - host_now_ns())));
  }

  CameraScript script_;
  CameraInfo info_;
  CameraSettings settings_;
  bool running_ = false;
  std::int64_t next_ = 0;
  std::int64_t number_ = 0;
  std::deque<std::int64_t> pulses_;
};

}  // namespace

std::unique_ptr<CameraDevice> make_scripted_camera(CameraScript script) {
  return std::make_unique<ScriptedCamera>(std::move(script));
}

}  // namespace pencilscan
