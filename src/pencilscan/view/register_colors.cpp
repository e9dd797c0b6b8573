#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "pencilscan/core/parallel.h"
#include "pencilscan/view/unmix.h"

namespace pencilscan {
namespace {

constexpr int kReach = 3;  ///< Lanczos' window: blurs lines less than a cubic would

/// Where one sample of a row or column comes from.
struct Taps {
  int first = 0;
  std::array<float, 2 * kReach> weights{};
};

double lanczos(double x) {
  if (std::abs(x) < 1e-9) return 1;
  if (std::abs(x) >= kReach) return 0;
  const double t = std::numbers::pi * x;
  return kReach * std::sin(t) * std::sin(t / kReach) / (t * t);
}

/// Sample i of the result is at center + scale (i - center) + shift of the image.
std::vector<Taps> resampling(int count, double center, double scale, double shift) {
  std::vector<Taps> all(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    const double at = center + scale * (i - center) + shift;
    Taps& taps = all[static_cast<std::size_t>(i)];
    taps.first = static_cast<int>(std::floor(at)) - kReach + 1;
    double sum = 0;
    for (int k = 0; k < 2 * kReach; ++k) sum += lanczos(at - (taps.first + k));
    for (int k = 0; k < 2 * kReach; ++k)
      taps.weights[static_cast<std::size_t>(k)] =
          static_cast<float>(lanczos(at - (taps.first + k)) / sum);
  }
  return all;
}

/// Channel k resampled; the nearest pixel beyond the border.
void move_channel(const cv::Mat& image, int k, const std::vector<Taps>& across,
                  const std::vector<Taps>& down, cv::Mat& result) {
  cv::Mat_<float> moved(image.size());
  parallel_for(static_cast<std::size_t>(image.rows), [&](std::size_t row) {
    const auto* in = image.ptr<cv::Vec3f>(static_cast<int>(row));
    for (int x = 0; x < image.cols; ++x) {
      const Taps& taps = across[static_cast<std::size_t>(x)];
      float sum = 0;
      for (int i = 0; i < 2 * kReach; ++i)
        sum += taps.weights[static_cast<std::size_t>(i)] *
               in[std::clamp(taps.first + i, 0, image.cols - 1)][k];
      moved(static_cast<int>(row), x) = sum;
    }
  });
  parallel_for(static_cast<std::size_t>(image.rows), [&](std::size_t row) {
    const Taps& taps = down[row];
    auto* out = result.ptr<cv::Vec3f>(static_cast<int>(row));
    for (int x = 0; x < image.cols; ++x) out[x][k] = 0;
    for (int i = 0; i < 2 * kReach; ++i) {
      const float* in = moved[std::clamp(taps.first + i, 0, image.rows - 1)];
      const float weight = taps.weights[static_cast<std::size_t>(i)];
      for (int x = 0; x < image.cols; ++x) out[x][k] += weight * in[x];
    }
  });
}

}  // namespace

cv::Mat registered(const Camera& camera, const cv::Mat& image, cv::Point corner) {
  const ColorRegistration& registration = camera.color_registration;
  if (registration.none()) return image;
  cv::Mat result = image.clone();
  const Vec2 center = image_center(camera) - Vec2(corner.x, corner.y);
  for (std::size_t k = 0; k < 3; ++k) {
    const ColorDisplacement& color = registration.colors[k];
    if (color.none()) continue;
    move_channel(image, static_cast<int>(k),
                 resampling(image.cols, center.x(), color.scale, color.shift_px.x()),
                 resampling(image.rows, center.y(), color.scale, color.shift_px.y()), result);
  }
  return result;
}

}  // namespace pencilscan
