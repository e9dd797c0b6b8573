#include "pencilscan/io/linear_light.h"

namespace pencilscan {

cv::Mat linearized(const cv::Mat& image, double gamma, double black_level) {
  if (gamma == 1 && black_level == 0) return image;
  // A matrix of its own: OpenCV's results go into the bytes of what they are assigned to.
  cv::Mat linear;
  image.convertTo(linear, -1, 1 / (1 - black_level), -black_level / (1 - black_level));
  cv::max(linear, 0.0, linear);
  if (gamma != 1) cv::pow(linear, gamma, linear);
  return linear;
}

}  // namespace pencilscan
