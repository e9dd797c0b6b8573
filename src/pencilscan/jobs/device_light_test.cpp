#include "pencilscan/jobs/device_light.h"

#include <gtest/gtest.h>

#include <cmath>

namespace pencilscan {
namespace {

/// Frames of which every camera sees every projector with its own light.
std::vector<FrameRow> steady(std::size_t cameras, std::size_t projectors) {
  std::vector<FrameRow> rows(5);
  for (FrameRow& row : rows) {
    row.cameras.resize(cameras);
    for (std::size_t c = 0; c < cameras; ++c) {
      for (std::size_t p = 0; p < projectors; ++p)
        row.cameras[c].height_of_projector.push_back(0.1 * static_cast<double>(1 + c + 2 * p));
    }
  }
  return rows;
}

void expect_light(const std::vector<double>& light, const std::vector<double>& expected) {
  ASSERT_EQ(light.size(), expected.size());
  for (std::size_t d = 0; d < light.size(); ++d) EXPECT_NEAR(light[d], expected[d], 1e-12) << d;
}

TEST(DeviceLight, CameraAndProjectorAreToldApartOfTwoEach) {
  const SequenceDevices devices{{"cam0", "cam1"}, {"proj0", "proj1"}};
  std::vector<FrameRow> rows = steady(2, 2);
  for (double& height : rows[3].cameras[1].height_of_projector) height *= 0.5;
  for (CameraRow& camera : rows[4].cameras) camera.height_of_projector[0] *= 0.4;
  find_device_light(rows, devices);
  expect_light(rows[0].device_light, {1, 1, 1, 1});
  expect_light(rows[3].device_light, {1, 0.5, 1, 1});
  expect_light(rows[4].device_light, {1, 1, 0.4, 1});
}

TEST(DeviceLight, WhatIsNotSeenIsUnknownAndAccusesNobody) {
  const SequenceDevices devices{{"cam0", "cam1", "cam2"}, {"proj0", "proj1"}};
  std::vector<FrameRow> rows = steady(3, 2);
  for (CameraRow& camera : rows[2].cameras) camera.height_of_projector[1] = kUnknownFigure;
  rows[3].cameras[0].height_of_projector.clear();
  find_device_light(rows, devices);
  EXPECT_TRUE(std::isnan(rows[2].device_light[4]));
  rows[2].device_light.pop_back();
  expect_light(rows[2].device_light, {1, 1, 1, 1});
  EXPECT_TRUE(std::isnan(rows[3].device_light[0]));
  rows[3].device_light.erase(rows[3].device_light.begin());
  expect_light(rows[3].device_light, {1, 1, 1, 1});
}

}  // namespace
}  // namespace pencilscan
