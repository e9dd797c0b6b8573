#include "pencilscan/view/sample_color.h"

#include <algorithm>
#include <cmath>

namespace pencilscan {

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
      const auto& value = image.at<cv::Vec3f>(v + dy, u + dx);
      if (std::max({value[0], value[1], value[2]}) >= full)
        return Eigen::Array3f::Constant(std::nanf(""));
      const float weight = (dx == 1 ? fx : 1 - fx) * (dy == 1 ? fy : 1 - fy);
      sum += weight * Eigen::Array3f(value[0], value[1], value[2]);
    }
  }
  return sum;
}

}  // namespace pencilscan
