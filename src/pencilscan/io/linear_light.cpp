#include "pencilscan/io/linear_light.h"

namespace pencilscan {

cv::Mat linearized(const cv::Mat& image, double gamma) {
  if (gamma == 1) return image;
  cv::Mat linear;
  cv::pow(cv::max(image, 0.0), gamma, linear);
  return linear;
}

}  // namespace pencilscan
