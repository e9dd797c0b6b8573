#include "reference_blur.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "pencilscan/core/check.h"
#include "pencilscan/core/stopwatch.h"

namespace pencilscan {

double median_seconds(const std::function<void()>& step, int runs) {
  PENCILSCAN_CHECK(runs >= 1);
  step();
  std::vector<double> seconds;
  for (int run = 0; run < runs; ++run) {
    const Stopwatch watch;
    step();
    seconds.push_back(watch.seconds());
  }
  std::sort(seconds.begin(), seconds.end());
  const std::size_t middle = seconds.size() / 2;
  return seconds.size() % 2 == 1 ? seconds[middle] : (seconds[middle - 1] + seconds[middle]) / 2;
}

double reference_blur_seconds(int runs) {
  constexpr int kWidth = 1280;
  constexpr int kHeight = 960;
  constexpr double kSigmaPx = 1.1;
  const cv::Size kernel(5, 5);

  std::array<cv::Mat, 6> images;
  cv::RNG random(1);
  for (cv::Mat& image : images) {
    image.create(kHeight, kWidth, CV_32FC3);
    random.fill(image, cv::RNG::UNIFORM, 0.0, 1.0);
  }

  const int threads_before = cv::getNumThreads();
  cv::setNumThreads(1);
  cv::Mat blurred;
  const double seconds = median_seconds(
      [&] {
        for (const cv::Mat& image : images) {
          cv::GaussianBlur(image, blurred, kernel, kSigmaPx, kSigmaPx);
        }
      },
      runs);
  cv::setNumThreads(threads_before);
  return seconds;
}

}  // namespace pencilscan
