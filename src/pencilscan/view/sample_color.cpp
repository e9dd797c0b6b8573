#include "pencilscan/view/sample_color.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace pencilscan {
namespace {

/// Between (u, v) and the next pixels, whose values times `unit` are in [0, 1].
template <class Stored>
Eigen::Array3f sample(const cv::Mat& image, int u, int v, float fx, float fy, float unit,
                      float full) {
  const int channels = image.channels();
  const int green = channels == 1 ? 0 : 1;
  const int blue = channels == 1 ? 0 : 2;
  Eigen::Array3f sum = Eigen::Array3f::Zero();
  for (int dy = 0; dy < 2; ++dy) {
    const Stored* at = image.ptr<Stored>(v + dy) + static_cast<std::ptrdiff_t>(u) * channels;
    for (int dx = 0; dx < 2; ++dx, at += channels) {
      const float r = static_cast<float>(at[0]) * unit;
      const float g = static_cast<float>(at[green]) * unit;
      const float b = static_cast<float>(at[blue]) * unit;
      if (std::max({r, g, b}) >= full) return Eigen::Array3f::Constant(std::nanf(""));
      const float weight = (dx == 1 ? fx : 1 - fx) * (dy == 1 ? fy : 1 - fy);
      sum += weight * Eigen::Array3f(r, g, b);
    }
  }
  return sum;
}

}  // namespace

Eigen::Array3f sample_color(const cv::Mat& image, double x, double y, float full) {
  const int u = static_cast<int>(std::floor(x));
  const int v = static_cast<int>(std::floor(y));
  if (u < 0 || v < 0 || u + 1 >= image.cols || v + 1 >= image.rows)
    return Eigen::Array3f::Constant(std::nanf(""));
  const auto fx = static_cast<float>(x - u);
  const auto fy = static_cast<float>(y - v);
  switch (image.depth()) {
    case CV_8U:
      return sample<std::uint8_t>(image, u, v, fx, fy, 1.F / 255, full);
    case CV_16U:
      return sample<std::uint16_t>(image, u, v, fx, fy, 1.F / 65535, full);
    default:
      return sample<float>(image, u, v, fx, fy, 1, full);
  }
}

}  // namespace pencilscan
