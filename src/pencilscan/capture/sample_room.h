#pragma once

// A room for tests, and its light.

#include <array>
#include <atomic>
#include <cmath>
#include <functional>
#include <mutex>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "pencilscan/core/host_clock.h"
#include "pencilscan/display/projector_screen.h"

namespace pencilscan::sample {

inline constexpr int kWidth = 64;
inline constexpr int kHeight = 48;

/// A room with two projectors before a flat wall: a camera pixel sees the panel pixel of its place,
/// twice as fine. What projectors show takes effect after a delay.
class Room : public ProjectorScreen {
 public:
  Room() : shown_(2) {
    for (const char* name : {"proj0", "proj1"}) {
      Projector projector;
      projector.name = name;
      projector.width = kWidth;
      projector.height = kHeight;
      projectors_.push_back(projector);
    }
    for (auto& history : shown_)
      history.push_back({INT64_MIN, cv::Mat(kHeight, kWidth, CV_8UC3, cv::Scalar::all(0))});
  }

  const std::vector<Projector>& projectors() const override { return projectors_; }
  double refresh_hz(std::size_t) const override { return 60; }
  std::vector<Fault> check() override { return {}; }
  std::int64_t show(std::size_t projector, const ProjectorPicture& picture) override {
    const cv::Mat panel = render_picture(picture, projectors_[projector]);
    const std::lock_guard lock(mutex_);
    const std::int64_t now = host_now_ns();
    shown_[projector].push_back({now + pause_ns(++shows), panel});
    return now;
  }

  /// The light that a camera has collected from begin on.
  cv::Mat seen(std::size_t camera, std::int64_t begin, double exposure_us) const {
    const std::lock_guard lock(mutex_);
    cv::Mat sum(2 * kHeight, 2 * kWidth, CV_32FC3, cv::Scalar::all(6));
    for (std::size_t p = 0; p < shown_.size(); ++p) {
      if (blind(camera, p)) continue;
      constexpr int kSteps = 8;  // of the exposure
      for (int k = 0; k < kSteps; ++k) {
        const auto now = begin + static_cast<std::int64_t>(1e3 * exposure_us * k / kSteps);
        const double turns = 60e-9 * static_cast<double>(now % 1'000'000'000);
        const double lamp = 1 + flicker[p] * std::sin(2 * M_PI * turns);
        cv::Mat light;
        picture_at(p, now - delay_ns[p]).convertTo(light, CV_32FC3, 0.6 * lamp / kSteps);
        cv::resize(light, light, sum.size(), 0, 0, cv::INTER_NEAREST);
        sum += light;
      }
    }
    cv::Mat result;
    sum.convertTo(result, CV_8UC3);
    if (!moved) return result;
    constexpr int kBy = 8;  // px
    cv::Mat pushed(result.size(), result.type(), cv::Scalar::all(6));
    result.colRange(0, result.cols - kBy).copyTo(pushed.colRange(kBy, result.cols));
    return pushed;
  }

  std::array<std::atomic<std::int64_t>, 2> delay_ns{15'000'000, 15'000'000};
  std::array<std::atomic<double>, 2> flicker{0, 0};  ///< by which light changes within 1/60 s
  std::atomic<int> shows = 0;
  std::atomic<bool> moved = false;
  /// What a busy computer adds to the delay of the show of this number, from 1.
  std::function<std::int64_t(int show)> pause_ns = [](int) { return 0; };
  std::function<bool(std::size_t camera, std::size_t projector)> blind =
      [](std::size_t, std::size_t) { return false; };

 private:
  struct Shown {
    std::int64_t time_ns;
    cv::Mat panel;
  };
  const cv::Mat& picture_at(std::size_t projector, std::int64_t time) const {
    const auto& history = shown_[projector];
    std::size_t k = history.size() - 1;
    while (k > 0 && history[k].time_ns > time) --k;
    return history[k].panel;
  }

  std::vector<Projector> projectors_;
  mutable std::mutex mutex_;
  std::vector<std::vector<Shown>> shown_;
};

}  // namespace pencilscan::sample
