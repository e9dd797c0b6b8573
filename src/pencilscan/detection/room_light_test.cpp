#include "pencilscan/detection/room_light.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "pencilscan/core/random.h"
#include "pencilscan/detection/detect.h"

namespace pencilscan {
namespace {

constexpr int kSide = 240;        // px
constexpr double kPitch = 12;     // px: what two_color_rig() states
constexpr double kLineWidth = 4;  // px
constexpr double kLine = 0.4;     // light of a line on white
constexpr double kBlur = 0.7;     // px

double step(double d) { return 0.5 * (1 + std::erf(d / (kBlur * std::sqrt(2.0)))); }

/// How far a pixel lies across a direction, px.
double across(double x, double y, double degrees) {
  const double angle = degrees * std::numbers::pi / 180;
  return y * std::cos(angle) - x * std::sin(angle);
}

/// How much of a pixel is on the bright half of stripes `width` px wide.
double on_stripe(double d, double period, double width) {
  const double from_middle = d - period * std::round(d / period);
  return step(from_middle + width / 2) * step(width / 2 - from_middle);
}

/// Two families of lines across each other: blue and cyan, red and yellow.
cv::Vec3d lines_at(double x, double y) {
  cv::Vec3d light(0, 0, 0);
  const std::array<double, 2> directions = {80, 10};
  for (std::size_t f = 0; f < 2; ++f) {
    const double d = across(x, y, directions[f]);
    const double height = kLine * on_stripe(d, kPitch, kLineWidth);
    light[f == 0 ? 2 : 0] += height;
    if (std::lround(d / kPitch) % 2 == 0) light[1] += height;
  }
  return light;
}

/// What lies under the light; `stripe`: how much of a pixel is on every other stripe.
using Paint = cv::Vec3d (*)(double stripe);
cv::Vec3d white(double) { return {0.8, 0.8, 0.8}; }
cv::Vec3d black_and_white(double stripe) {
  const double albedo = 0.08 + 0.72 * stripe;
  return {albedo, albedo, albedo};
}
cv::Vec3d red_and_white(double stripe) {
  return stripe * cv::Vec3d(0.7, 0.1, 0.1) + (1 - stripe) * cv::Vec3d(0.8, 0.8, 0.8);
}

/// A surface whose stripes lie at 45 degrees, in the light of the lines and of the room.
cv::Mat picture(Paint paint, const cv::Vec3d& room, bool has_lines = true) {
  constexpr double kPeriod = 26;  // px
  cv::Mat image(kSide, kSide, CV_32FC3);
  for (int y = 0; y < kSide; ++y) {
    Random random(5, static_cast<std::uint64_t>(y));
    for (int x = 0; x < kSide; ++x) {
      const cv::Vec3d albedo = paint(on_stripe(across(x, y, 45), kPeriod, kPeriod / 2));
      const cv::Vec3d light = room + (has_lines ? lines_at(x, y) : cv::Vec3d(0, 0, 0));
      for (int c = 0; c < 3; ++c)
        image.at<cv::Vec3f>(y, x)[c] =
            static_cast<float>(albedo[c] * light[c] + random.normal(0, 0.004));
    }
  }
  return image;
}

const cv::Vec3d kDark = {0.01, 0.01, 0.01};
const cv::Vec3d kLamp = {0.4, 0.36, 0.28};

TEST(RoomLight, IsToldFromLines) {
  EXPECT_FALSE(room_shows_prints(picture(white, kDark), kPitch));
  EXPECT_FALSE(room_shows_prints(picture(black_and_white, kDark), kPitch));
  EXPECT_FALSE(room_shows_prints(picture(white, kLamp), kPitch)) << "it shows nothing";
  EXPECT_TRUE(room_shows_prints(picture(black_and_white, kLamp), kPitch));
  EXPECT_TRUE(room_shows_prints(picture(red_and_white, kLamp), kPitch));
  EXPECT_FALSE(room_shows_prints(picture(black_and_white, kLamp), 0))
      << "a rig that does not say its pitch";
}

TEST(RoomLight, NeedsLinesThatLackAChannel) {
  ColorFamily family;
  family.colors = {"blue", "cyan"};
  EXPECT_TRUE(lines_lack_a_channel({family}));
  family.colors = {"white"};
  EXPECT_FALSE(lines_lack_a_channel({family}));
}

/// What is left off the lines, mean, as a share of a line on white.
double left_between_lines(const cv::Mat& light) {
  double sum = 0;
  int count = 0;
  for (int y = 20; y < kSide - 20; ++y) {
    for (int x = 20; x < kSide - 20; ++x) {
      const cv::Vec3d lines = lines_at(x, y);
      if (lines[0] + lines[2] > 0.02 * kLine) continue;
      const auto& v = light.at<cv::Vec3f>(y, x);
      sum += (std::abs(v[0]) + std::abs(v[2])) / 2;
      ++count;
    }
  }
  return sum / (0.8 * kLine * count);
}

TEST(RoomLight, LeavesLittleOfStripesOfTheSurface) {
  const cv::Mat neutral = picture(black_and_white, kLamp);
  EXPECT_GT(left_between_lines(neutral), 0.4);
  EXPECT_LT(left_between_lines(without_room_light(neutral, kPitch)), 0.06);
  const cv::Mat colored = picture(red_and_white, kLamp);
  EXPECT_GT(left_between_lines(colored), 0.3);
  EXPECT_LT(left_between_lines(without_room_light(colored, kPitch)), 0.06);
}

Rig two_color_rig() {
  Rig rig;
  Camera camera;
  camera.name = "cam";
  camera.width = camera.height = kSide;
  camera.color_matrix = Mat3::Identity();
  camera.device_from_world.translation = {0, 0, 1};
  rig.cameras = {camera};
  rig.volume = Sphere{{0, 0, 0}, 0.5};
  for (int p = 0; p < 2; ++p) {
    Projector projector;
    projector.width = projector.height = 100;
    projector.device_from_world.translation = {0, 0, 1};
    projector.patterns = {LinePattern()};
    if (p == 1) projector.patterns[0].colors = {"red", "yellow"};
    rig.projectors.push_back(projector);
  }
  return rig;
}

/// Points of curves that run along the stripes, and along lines.
std::pair<std::size_t, std::size_t> along_stripes_and_lines(const cv::Mat& image) {
  const Rig rig = two_color_rig();
  std::size_t stripes = 0;
  std::size_t lines = 0;
  for (const Curve& curve : detect_curves(rig.cameras[0], rig, color_families(rig), image).curves) {
    for (const CurvePoint& point : curve.points) {
      const double degrees =
          std::atan2(point.tangent().y(), point.tangent().x()) * 180 / std::numbers::pi;
      const auto runs_along = [&](double direction) {
        return std::abs(std::remainder(degrees - direction, 180)) < 8;
      };
      if (runs_along(45)) ++stripes;
      if (runs_along(curve.family == 0 ? 80 : 10)) ++lines;
    }
  }
  return {stripes, lines};
}

TEST(RoomLight, StripesOfTheSurfaceAreNoLines) {
  for (const Paint paint : {black_and_white, red_and_white}) {
    const auto [stripes, lines] = along_stripes_and_lines(picture(paint, kLamp));
    EXPECT_LT(stripes, lines / 20);
  }
}

}  // namespace
}  // namespace pencilscan
