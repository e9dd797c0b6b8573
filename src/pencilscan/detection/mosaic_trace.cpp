#include "pencilscan/detection/mosaic_trace.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "pencilscan/core/check.h"

namespace pencilscan {
namespace {

/// |value - mean of its four neighbours| at one place of a 2 x 2 mosaic.
struct PhaseSum {
  double sum = 0;
  double squares = 0;
  double count = 0;

  [[nodiscard]] double mean() const { return sum / count; }
  /// Standard deviation of the mean.
  [[nodiscard]] double error() const {
    return std::sqrt(std::max(0.0, squares / count - mean() * mean()) / count);
  }
};

std::array<PhaseSum, 4> phase_sums(const cv::Mat& rgb, int channel) {
  std::array<PhaseSum, 4> phases;
  // Of each four rows two, which hold all four places.
  for (int y = 1; y + 1 < rgb.rows; y += y % 4 == 1 ? 1 : 3) {
    const auto* above = rgb.ptr<cv::Vec3f>(y - 1);
    const auto* here = rgb.ptr<cv::Vec3f>(y);
    const auto* below = rgb.ptr<cv::Vec3f>(y + 1);
    for (int x = 1; x + 1 < rgb.cols; ++x) {
      const float around =
          here[x - 1][channel] + here[x + 1][channel] + above[x][channel] + below[x][channel];
      const auto d = static_cast<double>(std::abs(here[x][channel] - 0.25F * around));
      PhaseSum& phase = phases[static_cast<std::size_t>(2 * (y % 2) + x % 2)];
      phase.sum += d;
      phase.squares += d * d;
      phase.count += 1;
    }
  }
  return phases;
}

}  // namespace

bool looks_interpolated(const cv::Mat& rgb) {
  PENCILSCAN_CHECK(rgb.type() == CV_32FC3);
  constexpr double kDeviations = 8;  // of the difference; neighbouring values are not independent
  if (rgb.rows < 16 || rgb.cols < 16) return false;
  for (const int channel : {0, 2}) {  // a quarter of the samples each
    const std::array<PhaseSum, 4> phases = phase_sums(rgb, channel);
    const auto [least, most] = std::minmax_element(
        phases.begin(), phases.end(), [](const auto& a, const auto& b) { return a.sum < b.sum; });
    const double error = std::hypot(least->error(), most->error());
    if (error > 0 && most->mean() - least->mean() > kDeviations * error) return true;
  }
  return false;
}

}  // namespace pencilscan
