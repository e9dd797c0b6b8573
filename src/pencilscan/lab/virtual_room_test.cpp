#include "pencilscan/lab/virtual_room.h"

#include <gtest/gtest.h>

#include "pencilscan/core/host_clock.h"
#include "pencilscan/display/projector_picture.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

constexpr std::int64_t kMs = 1'000'000;

cv::Mat even(int level) { return {2, 2, CV_8UC3, cv::Scalar::all(level)}; }

TEST(LightHistory, SharesAreThoseOfTheTimeShown) {
  LightHistory history;
  EXPECT_TRUE(history.during(0, kMs).empty());
  history.add(0, even(0));
  history.add(100 * kMs, even(200));
  history.add(200 * kMs, even(0));
  const auto parts = history.during(90 * kMs, 220 * kMs);
  ASSERT_EQ(parts.size(), 3U);
  EXPECT_NEAR(parts[0].share, 10.0 / 130, 1e-12);
  EXPECT_NEAR(parts[1].share, 100.0 / 130, 1e-12);
  EXPECT_EQ(parts[1].picture->at<cv::Vec3b>(0, 0)[0], 200);
  EXPECT_EQ(parts[0].picture, parts[2].picture);  // equal pictures are one
  // Before everything, the first.
  ASSERT_EQ(history.during(-5 * kMs, -kMs).size(), 1U);
}

/// Two cameras and two projectors before a ball.
class Room : public ::testing::Test {
 protected:
  Room() : rig_(sample::small_rig(160, 120, 70)), room_(rig_, quiet()) {
    room_.place(SimulatedObject(make_sphere(60, 60)));
    for (std::size_t p = 0; p < 2; ++p) show(p, {}, 0);
  }
  static PhotographyOptions quiet() {
    PhotographyOptions photo;
    photo.noise = "none";
    return photo;
  }
  void show(std::size_t p, const ProjectorPicture& picture, std::int64_t time) {
    room_.show(p, time, render_picture(picture, rig_.projectors[p]));
  }
  [[nodiscard]] double level(std::size_t camera, std::int64_t begin) {
    return cv::mean(room_.expose(camera, begin, 1000 * kRoomExposureMs, 1, std::nullopt))[1];
  }

  Rig rig_;
  VirtualRoom room_;
};

TEST_F(Room, LightIsThatOfTheSimulator) {
  show(0, {ProjectorPicture::Kind::kWhite, 0, {}}, 0);
  std::vector<PanelLight> lights(2);
  FilmOptions film;
  film.black_level = 0.004;
  lights[0] = solid_light(rig_.projectors[0], {"white", {1, 1, 1}}, film);
  lights[1] = solid_light(rig_.projectors[1], {"black", {0, 0, 0}}, film);
  const cv::Mat expected = apply_sensor(
      render_camera(rig_, 1, SimulatedObject(make_sphere(60, 60)), lights), SensorOptions{}, 1);
  const cv::Mat seen = room_.expose(1, 100 * kMs, 1000 * kRoomExposureMs, 1, std::nullopt);
  EXPECT_GT(cv::mean(expected)[1], 5);
  EXPECT_LE(cv::norm(seen, expected, cv::NORM_INF), 1);
}

TEST_F(Room, LightComesLateAndInParts) {
  const double dark = level(0, 10 * kMs);
  room_.set_delay(0, 50);
  show(0, {ProjectorPicture::Kind::kWhite, 0, {}}, 100 * kMs);
  EXPECT_EQ(level(0, 120 * kMs), dark);
  const double all = level(0, 160 * kMs);
  EXPECT_GT(all, dark + 5);
  const auto half = static_cast<std::int64_t>(150e6 - 0.5e6 * kRoomExposureMs);
  EXPECT_NEAR(level(0, half), (all + dark) / 2, 0.5);
}

TEST_F(Room, CablesCanBeExchanged) {
  show(0, {ProjectorPicture::Kind::kWhite, 0, {}}, 0);
  const cv::Mat right = room_.expose(0, 10 * kMs, 1000 * kRoomExposureMs, 1, std::nullopt);
  room_.swap_cables(0, 1);
  const cv::Mat wrong =
      room_.expose(0, host_now_ns() + kMs, 1000 * kRoomExposureMs, 1, std::nullopt);
  EXPECT_GT(cv::norm(right, wrong, cv::NORM_INF), 20);
}

TEST_F(Room, ExposuresGainAndMosaicsCount) {
  show(0, {ProjectorPicture::Kind::kWhite, 0, {}}, 0);
  const double once = level(0, 10 * kMs);
  const double half =
      cv::mean(room_.expose(0, 10 * kMs, 500 * kRoomExposureMs, 1, std::nullopt))[1];
  EXPECT_NEAR(half, once / 2, 0.5);
  const cv::Mat raw =
      room_.expose(0, 10 * kMs, 500 * kRoomExposureMs, 2, Mosaic::from_name("RGGB"));
  EXPECT_EQ(raw.type(), CV_8UC1);
  EXPECT_NEAR(cv::mean(raw)[0], once, 0.5);
}

}  // namespace
}  // namespace pencilscan
