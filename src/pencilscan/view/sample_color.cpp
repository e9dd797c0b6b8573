#include "pencilscan/view/sample_color.h"

#include <cmath>
#include <cstddef>
#include <cstdint>

namespace pencilscan {
namespace {

template <class Stored>
Eigen::Array3f value_at(const cv::Mat& image, int u, int v, float unit) {
  const int channels = image.channels();
  const Stored* at = image.ptr<Stored>(v) + static_cast<std::ptrdiff_t>(u) * channels;
  const auto value = [&](int k) { return static_cast<float>(at[k]) * unit; };
  if (channels == 1) return Eigen::Array3f::Constant(value(0));
  return {value(0), value(1), value(2)};
}

Eigen::Array3f value_at(const cv::Mat& image, int u, int v) {
  switch (image.depth()) {
    case CV_8U:
      return value_at<std::uint8_t>(image, u, v, 1.F / 255);
    case CV_16U:
      return value_at<std::uint16_t>(image, u, v, 1.F / 65535);
    default:
      return value_at<float>(image, u, v, 1);
  }
}

}  // namespace

Eigen::Array3f sample_color(const cv::Mat& image, double x, double y, float full) {
  const int u = static_cast<int>(std::floor(x));
  const int v = static_cast<int>(std::floor(y));
  if (u < 0 || v < 0 || u + 1 >= image.cols || v + 1 >= image.rows)
    return Eigen::Array3f::Constant(std::nanf(""));
  const auto fx = static_cast<float>(x - u);
  const auto fy = static_cast<float>(y - v);
  Eigen::Array3f sum = Eigen::Array3f::Zero();
  for (int dy = 0; dy < 2; ++dy) {
    for (int dx = 0; dx < 2; ++dx) {
      const Eigen::Array3f value = value_at(image, u + dx, v + dy);
      if (value.maxCoeff() >= full) return Eigen::Array3f::Constant(std::nanf(""));
      const float weight = (dx == 1 ? fx : 1 - fx) * (dy == 1 ? fy : 1 - fy);
      sum += weight * value;
    }
  }
  return sum;
}

}  // namespace pencilscan
