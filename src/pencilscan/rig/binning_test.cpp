#include "pencilscan/rig/binning.h"

#include <gtest/gtest.h>

#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

TEST(Binned, PixelsStandForThoseAroundTheirPlace) {
  cv::Mat image(31, 41, CV_32FC3);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u)
      image.at<cv::Vec3f>(v, u) = {0.01F * static_cast<float>(u), 0.01F * static_cast<float>(v),
                                   0.2F + 0.002F * static_cast<float>(u + v)};
  }
  for (const int n : {2, 3, 4}) {
    const cv::Mat means = binned(image, n);
    ASSERT_EQ(means.size(), cv::Size(40 / n + 1, 30 / n + 1));
    for (int v = 1; v < 30 / n; ++v) {
      for (int u = 1; u < 40 / n; ++u)
        EXPECT_LT(cv::norm(means.at<cv::Vec3f>(v, u) - image.at<cv::Vec3f>(n * v, n * u)), 1e-5);
    }
  }
}

TEST(Binned, BlurIsTheVarianceOfTheMeansWeights) {
  EXPECT_EQ(binning_blur_px2(1), 0);
  EXPECT_NEAR(binning_blur_px2(2), 0.5, 1e-6);      // 1/4, 1/2, 1/4
  EXPECT_NEAR(binning_blur_px2(3), 2.0 / 3, 1e-6);  // three thirds
  EXPECT_NEAR(binning_blur_px2(4), 1.5, 1e-6);      // 1/8, three quarters, 1/8
}

TEST(Binned, ACameraSeesTheSamePlacesAtThem) {
  Camera camera = sample::small_rig(640, 480, 110).cameras.front();
  camera.color_registration.colors[0].shift_px = Vec2(0.6, -0.3);
  const Camera coarse = binned(camera, 3);
  EXPECT_EQ(coarse.width, 214);
  const Vec3 place(10, -20, 30);
  EXPECT_LT((3 * *coarse.project(place) - *camera.project(place)).norm(), 1e-9);
  EXPECT_NEAR(coarse.color_registration.colors[0].shift_px.x(), 0.2, 1e-12);
}

}  // namespace
}  // namespace pencilscan
