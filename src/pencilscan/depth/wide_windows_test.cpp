#include "pencilscan/depth/wide_windows.h"

#include <gtest/gtest.h>

#include <limits>

#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

/// A camera's light of one family, the same at every pixel but for what `sampled` leaves out.
CameraLight even_light(const Camera& camera) {
  CameraLight light;
  light.camera = &camera;
  light.families = {cv::Mat(camera.height, camera.width, CV_32FC1, cv::Scalar(0.25))};
  light.sampled = {cv::Mat()};
  light.valid = cv::Mat(camera.height, camera.width, CV_8UC1, cv::Scalar(1));
  light.noise = {NoiseModel{0.01F, 0.02F}};
  return light;
}

TEST(WideWindows, LightIsJoinedWithItsNoiseAndBlur) {
  const Camera camera = sample::small_rig(64, 48, 110).cameras.front();
  CameraLight light = even_light(camera);
  light.blur_px = 1;
  light.valid.at<std::uint8_t>(20, 30) = 0;
  // Samples in every second pixel of every second row; what is between is wrong.
  light.sampled[0] = cv::Mat(camera.height, camera.width, CV_8UC1, cv::Scalar(0));
  for (int v = 0; v < camera.height; v += 2) {
    for (int u = 0; u < camera.width; u += 2) light.sampled[0].at<std::uint8_t>(v, u) = 255;
  }
  light.families[0].setTo(7, light.sampled[0] == 0);
  const CameraLight wide = binned_light(light, 2);
  EXPECT_EQ(wide.camera->width, 32);
  EXPECT_EQ(wide.camera, wide.own_camera.get());
  EXPECT_FLOAT_EQ(wide.families[0].at<float>(5, 9), 0.25F);
  EXPECT_FLOAT_EQ(wide.noise[0].offset, 0.01F);  // one sample of four pixels
  EXPECT_FLOAT_EQ(wide.noise[0].slope, 0.02F);
  light.sampled[0] = cv::Mat();
  EXPECT_FLOAT_EQ(binned_light(light, 2).noise[0].offset, 0.0025F);
  EXPECT_FLOAT_EQ(wide.blur_px, std::sqrt(1.5F) / 2);
  EXPECT_EQ(wide.valid.at<std::uint8_t>(10, 15), 0);
  EXPECT_EQ(wide.valid.at<std::uint8_t>(10, 17), 1);
}

TEST(WideWindows, JoinNoMorePixelsThanNodesAreApart) {
  DepthOptions options;
  EXPECT_EQ(binning_for(std::numeric_limits<double>::infinity(), options), options.stride);
  options.stride = 3;
  EXPECT_EQ(binning_for(1e6, options), 2);
}

TEST(WideWindows, GoAsFarAsLinesLieApartAndLeaveTheMapInItsPixels) {
  const Camera camera = sample::small_rig(64, 48, 110).cameras.front();
  const CameraLight light = even_light(camera);
  const DepthOptions options;  // windows of 11 px, nodes 4 px apart
  DepthMap map;
  map.stride = options.stride;
  map.columns = 16;
  map.rows = 12;
  map.nodes.resize(16 * 12);
  DepthNode& node = map.nodes[map.index(3, 5)];
  node.w = 0.002F;
  node.wx = 1e-5F;
  node.wxy = 1e-6F;
  const auto widths_at = [&](double spacing_px) {
    std::vector<int> widths;
    const int widest = binning_for(spacing_px, options);
    with_wider_windows(light, widest, map, [&](const CameraLight& wide, DepthMap& m) {
      widths.push_back(wide.camera->width);
      const int n = 64 / wide.camera->width;
      EXPECT_EQ(n * m.pixel(m.index(3, 5)), Vec2(20, 12));
      EXPECT_FLOAT_EQ(m.nodes[m.index(3, 5)].wx, static_cast<float>(n) * 1e-5F);
      EXPECT_FLOAT_EQ(m.nodes[m.index(3, 5)].wxy, static_cast<float>(n * n) * 1e-6F);
    });
    return widths;
  };
  EXPECT_EQ(widths_at(11.5), std::vector<int>());
  EXPECT_EQ(widths_at(22), std::vector<int>({32}));
  EXPECT_EQ(widths_at(40), std::vector<int>({32, 16}));
  EXPECT_EQ(widths_at(400), std::vector<int>({32, 16}));  // nodes would lie half a pixel apart
  EXPECT_EQ(map.stride, 4);
  EXPECT_EQ(map.nodes[map.index(3, 5)].wx, 1e-5F);
}

}  // namespace
}  // namespace pencilscan
