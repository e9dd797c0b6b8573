#include "pencilscan/simulation/photography.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace pencilscan {
namespace {

/// A camera of white light 1 m before a board, whose edge at y = 0 runs down the middle of its
/// picture: 2 px are 1 mm.
class PhotographyTest : public testing::Test {
 protected:
  PhotographyTest() {
    Camera camera;
    camera.name = "cam0";
    camera.width = 121;
    camera.height = 21;
    camera.K << 2000, 0, 60, 0, 2000, 10, 0, 0, 1;
    camera.device_from_world = look_at({1000, 0, 0}, Vec3::Zero());
    camera.sees_texture_only = true;
    rig_.cameras.push_back(camera);
    Projector projector;
    projector.name = "proj0";
    projector.width = projector.height = 64;
    projector.K << 100, 0, 32, 0, 100, 32, 0, 0, 1;
    projector.device_from_world = look_at({1000, 0, 0}, Vec3::Zero());
    projector.patterns.emplace_back();
    rig_.projectors.push_back(projector);
    rig_.volume = Sphere{Vec3::Zero(), 50};
    surface_.smooth = false;
    photo_.bits = 16;
  }

  /// The middle row of what the camera stores of a board that goes `shift` in the exposure.
  [[nodiscard]] std::vector<double> row(const Vec3& shift) const {
    const TriangleMesh board = make_box({10, 200, 400}, {-5, 100, 0});
    constexpr double kFootprint = 0.5;
    const auto moments = through_exposure(board, surface_, {}, {.shift = shift}, kFootprint);
    const cv::Mat picture = photograph(rig_, 0, moments, photo_, 0);
    std::vector<double> values;
    for (int x = 0; x < picture.cols; ++x)
      values.push_back(picture.at<cv::Vec3w>(10, x)[1] / 65535.0);
    return values;
  }

  Rig rig_;
  Reflectance surface_;
  PhotographyOptions photo_;
};

TEST_F(PhotographyTest, AnEdgeThatMovesIsARampAsLongAsItsWay) {
  const std::vector<double> still = row(Vec3::Zero());
  const bool lit_left = still.front() > still.back();
  const double full = still[lit_left ? 20 : 100];
  ASSERT_GT(full, 0.1);
  constexpr double kWay = 20;  // px
  const std::vector<double> moved = row({0, kWay / 2, 0});
  for (int x = 20; x <= 100; ++x) {
    const double from_edge = lit_left ? 60.0 - x : x - 60.0;
    const double share = std::clamp(0.5 + from_edge / kWay, 0.0, 1.0);
    // Light falls by less than 1 % over this part of the board; steps are half a pixel.
    EXPECT_NEAR(moved[static_cast<std::size_t>(x)] / full, share, 0.03) << x;
  }
}

TEST_F(PhotographyTest, WhatMovesAlongTheEdgeOrNotAtAllKeepsIt) {
  const std::vector<double> still = row(Vec3::Zero());
  EXPECT_EQ(row({0, 0, 0}), still);
  const std::vector<double> along = row({0, 0, 3});
  for (std::size_t x = 0; x < still.size(); ++x) EXPECT_NEAR(along[x], still[x], 1e-3) << x;
}

TEST_F(PhotographyTest, AWallWithoutACornerInViewIsSeen) {
  const TriangleMesh wall = make_box({10, 1e5, 1e5}, Vec3::Zero());
  EXPECT_NO_THROW(check_scene(rig_, wall, "mesh", "rig"));
  const TriangleMesh behind = make_box({10, 1e5, 1e5}, {2000, 0, 0});
  EXPECT_THROW(check_scene(rig_, behind, "mesh", "rig"), InputError);
}

TEST_F(PhotographyTest, AWayOfThousandsOfPixelsIsRefused) {
  const auto moved_by = [&](double mm) {
    return through_exposure(make_box({1, 1, 1}, Vec3::Zero()), surface_, {},
                            {.shift = Vec3(0, mm, 0)}, 0.5);
  };
  EXPECT_EQ(moved_by(128).size(), 512U);
  EXPECT_THROW(moved_by(1000), InputError);
  EXPECT_THROW(moved_by(1e300), InputError);
}

TEST_F(PhotographyTest, MomentsAreEvenAroundTheMiddleOfTheExposure) {
  const auto moments =
      through_exposure(make_box({1, 1, 1}, Vec3::Zero()), surface_,
                       {Mat3::Identity(), Vec3(5, 0, 0)}, {.shift = Vec3(0, 2, 0)}, 0.5);
  ASSERT_EQ(moments.size(), 8U);
  Vec3 mean = Vec3::Zero();
  for (const SimulatedObject& moment : moments)
    mean += moment.world_from_object().translation / static_cast<double>(moments.size());
  EXPECT_LT((mean - Vec3(5, 0, 0)).norm(), 1e-12);
  EXPECT_NEAR(moments.front().world_from_object().translation.y(), -0.875, 1e-12);
}

TEST_F(PhotographyTest, WhatTurnsGoesFarthestAtItsRim) {
  constexpr double kTurn = 0.1;  // rad, through the exposure
  const Vec3 pivot(0, 5, 0);
  const Vec3 rim(0, 105,
                 0);  // 100 mm off the axis: 10 mm of way, 40 half-millimetre steps at least
  const auto moments = through_exposure(make_box({1, 1, 1}, rim), surface_, {},
                                        {.turn_rad = kTurn * Vec3::UnitZ(), .pivot = pivot}, 0.5);
  EXPECT_GE(moments.size(), 40U);
  const RigidTransform& first = moments.front().world_from_object();
  const RigidTransform& last = moments.back().world_from_object();
  EXPECT_LT((first * pivot - pivot).norm(), 1e-12);
  const auto steps = static_cast<double>(moments.size());
  EXPECT_NEAR((last * rim - first * rim).norm(), 100 * kTurn * (steps - 1) / steps, 0.01);
  EXPECT_LT((0.5 * (last * rim + first * rim) - rim).norm(), 0.2) << "sagitta of 10 mm";
}

}  // namespace
}  // namespace pencilscan
