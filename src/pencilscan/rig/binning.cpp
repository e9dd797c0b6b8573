#include "pencilscan/rig/binning.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "pencilscan/core/check.h"

namespace pencilscan {
namespace {

/// Weights along a row, from -n / 2 to n / 2.
cv::Mat weights_of(int binning) {
  PENCILSCAN_CHECK(binning >= 1);
  const int reach = binning / 2;
  cv::Mat weights(1, 2 * reach + 1, CV_32F, cv::Scalar(1.0 / binning));
  if (binning % 2 == 0)
    weights.at<float>(0) = weights.at<float>(2 * reach) = 0.5F / static_cast<float>(binning);
  return weights;
}

}  // namespace

cv::Mat binned(const cv::Mat& image, int binning) {
  PENCILSCAN_CHECK(image.depth() == CV_32F);
  if (binning == 1) return image;
  const cv::Mat weights = weights_of(binning);
  cv::Mat mean;
  cv::sepFilter2D(image, mean, -1, weights, weights, {-1, -1}, 0, cv::BORDER_REFLECT_101);
  cv::Mat result((image.rows - 1) / binning + 1, (image.cols - 1) / binning + 1, image.type());
  const std::size_t pixel = image.elemSize();
  const auto n = static_cast<std::size_t>(binning);
  for (int v = 0; v < result.rows; ++v) {
    const auto* in = mean.ptr(v * binning);
    auto* out = result.ptr(v);
    for (std::size_t u = 0; u < static_cast<std::size_t>(result.cols); ++u)
      std::copy_n(in + u * n * pixel, pixel, out + u * pixel);
  }
  return result;
}

cv::Mat binned(const cv::Mat& image, const cv::Mat& counted, int binning) {
  const cv::Mat count = binned(counted, binning);
  cv::Mat means = binned(image.mul(counted), binning) / count;
  const cv::Mat none = count == 0;
  if (cv::countNonZero(none) > 0) binned(image, binning).copyTo(means, none);
  return means;
}

double binning_blur_px2(int binning) {
  const cv::Mat weights = weights_of(binning);
  double variance = 0;
  for (int i = 0; i < weights.cols; ++i) {
    const double offset = i - binning / 2;
    variance += static_cast<double>(weights.at<float>(i)) * offset * offset;
  }
  return variance;
}

Camera binned(Camera camera, int binning) {
  if (binning == 1) return camera;
  camera.K.topRows<2>() /= binning;
  camera.width = (camera.width - 1) / binning + 1;
  camera.height = (camera.height - 1) / binning + 1;
  camera.mosaic.reset();
  camera.gamma = 1;
  camera.black_level = 0;
  for (ColorDisplacement& color : camera.color_registration.colors) color.shift_px /= binning;
  return camera;
}

}  // namespace pencilscan
