#include "pencilscan/uncertainty/exposure_motion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "pencilscan/core/random.h"
#include "pencilscan/uncertainty/blur_equations.h"

namespace pencilscan {
namespace {

/// Lines on a bumpy ball between six cameras and six projectors, each pair beside each other.
/// Variances follow the formula of the header with the motion given, on a baseline of defocus,
/// relief and noise.
std::vector<LineBlur> lines_of(const Vec3& shift, const Vec3& turn, double noise_px2,
                               std::uint64_t seed) {
  std::vector<LineBlur> lines;
  Random random(seed);
  const auto device = [](double angle, double height) {
    return Vec3(1000 * std::cos(angle), 1000 * std::sin(angle), height);
  };
  for (int c = 0; c < 6; ++c) {
    const Vec3 camera = device(c * std::numbers::pi / 3, 200);
    for (const int side : {-1, 1}) {
      const int p = (c + (side < 0 ? 5 : 0)) % 6;
      const Vec3 projector =
          device((c + 0.5 * side) * std::numbers::pi / 3, p % 2 == 0 ? 100 : 500);
      for (int i = 0; i < 400; ++i) {
        const Vec3 way(random.normal(0, 1), random.normal(0, 1), random.normal(0, 1));
        LineBlur line;
        line.point = 80 * way.normalized();
        const Vec3 bump(random.normal(0, 0.3), random.normal(0, 0.3), random.normal(0, 0.3));
        line.normal = (way.normalized() + bump).normalized();
        const Vec3 to_camera = (camera - line.point).normalized();
        const Vec3 to_projector = (projector - line.point).normalized();
        line.camera_cosine = line.normal.dot(to_camera);
        line.projector_cosine = line.normal.dot(to_projector);
        if (line.camera_cosine < 0.2 || line.projector_cosine < 0.2) continue;
        line.camera = c;
        line.projector = p;
        line.px_per_line = 6 * line.camera_cosine / line.projector_cosine;
        line.px_per_length = to_camera.cross(to_projector).norm() / line.projector_cosine;
        line.camera_depth = (camera - line.point).norm();
        line.projector_depth = (projector - line.point).norm();
        const double moved = line.px_per_length * line.normal.dot(shift + turn.cross(line.point));
        line.variance_px2 = 0.5 + 0.02 * c + 1e-4 * line.camera_depth +
                            0.002 * line.px_per_line * line.px_per_line +
                            0.01 * line.px_per_length * line.px_per_length + moved * moved / 12 +
                            random.normal(0, noise_px2);
        line.deviation_px2 = noise_px2;
        if (random.uniform() < 0.02) line.variance_px2 += 3;  // another line lies beside it
        lines.push_back(line);
      }
    }
  }
  return lines;
}

constexpr double kNoise = 0.05;  // px^2, of one window

TEST(ExposureMotion, WhatRestsIsNotSeenToMove) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const ExposureMotion motion =
        exposure_motion(lines_of(Vec3::Zero(), Vec3::Zero(), kNoise, seed));
    EXPECT_TRUE(motion.is_judged);
    EXPECT_FALSE(motion.is_seen) << seed;
    EXPECT_LT(motion.at_most, 1.2) << seed;
  }
}

/// What a square pixel does to the width of lines, here where lines run as the surface turns.
void add_pixel_shape(std::vector<LineBlur>& lines) {
  for (LineBlur& line : lines) {
    const double x2 = line.normal.x() * line.normal.x();
    line.direction = std::acos(2 * x2 - 1) / 4;
    line.variance_px2 += 0.05 * std::cos(4 * line.direction);
  }
}

TEST(ExposureMotion, ThePixelsShapeIsNoMotion) {
  constexpr double kLittle = 0.01;
  for (const double shift : {0.0, 2.0}) {
    std::vector<LineBlur> lines = lines_of(Vec3(shift, 0, 0), Vec3::Zero(), kLittle, 7);
    add_pixel_shape(lines);
    const ExposureMotion motion = exposure_motion(lines);
    EXPECT_EQ(motion.is_seen, shift > 0);
    if (motion.is_seen) {
      EXPECT_NEAR(motion.way, shift, 4 * motion.way_deviation + 0.1);
    }
  }
}

TEST(BlurFit, LeavesOutEachPairEachCameraAndEachProjector) {
  std::vector<LineBlur> lines = lines_of(Vec3(2, 0, 0), Vec3::Zero(), kNoise, 8);
  const MotionEquations ring = BlurFit(lines).equations();
  EXPECT_EQ(ring.pairs, 12U);
  EXPECT_EQ(ring.without[0].size(), 12U);
  EXPECT_EQ(ring.without[1].size(), 6U);
  EXPECT_EQ(ring.without[2].size(), 6U);
  // Less is known without a camera, which sees two of the pairs, than without one of them.
  const double all = ring.all.S.trace();
  EXPECT_LT(ring.without[1].front().S.trace(), ring.without[0].front().S.trace());
  EXPECT_LT(ring.without[0].front().S.trace(), all);
  std::erase_if(lines, [](const LineBlur& line) { return line.camera != 2; });
  EXPECT_TRUE(BlurFit(lines).equations().without[1].empty());
}

TEST(ExposureMotion, AShiftIsFoundWithItsDirection) {
  for (const Vec3& shift : {Vec3(2, 0, 0), Vec3(0.7, -1, 0.7), Vec3(0, 0, 4)}) {
    const ExposureMotion motion = exposure_motion(lines_of(shift, Vec3::Zero(), kNoise, 3));
    ASSERT_TRUE(motion.is_seen) << shift.transpose();
    const double sign = motion.shift.dot(shift) > 0 ? 1 : -1;
    // Four deviations: a chance of 1e-4 in one dimension, more in three.
    EXPECT_LT((sign * motion.shift - shift).norm(), 4 * motion.way_deviation + 0.1);
    EXPECT_NEAR(motion.way, shift.norm(), 4 * motion.way_deviation + 0.1);
    EXPECT_GT(motion.at_most, 0.9 * shift.norm());
    EXPECT_TRUE(motion.turn.isZero());
  }
}

TEST(ExposureMotion, WhatThePicturesMayHaveThemselvesIsNoMotion) {
  const std::vector<LineBlur> lines = lines_of(Vec3(2, 0, 0), Vec3::Zero(), kNoise, 3);
  constexpr double kUnknownPx2 = 2.0;
  const ExposureMotion motion = exposure_motion(lines, kUnknownPx2);
  EXPECT_FALSE(motion.is_seen);
  EXPECT_GT(motion.at_most, 2);
  EXPECT_TRUE(exposure_motion(lines, kUnknownPx2 / 100).is_seen);
}

TEST(ExposureMotion, ATurnIsFoundWithItsAxis) {
  const Vec3 turn(0, 0.01, 0.04);  // rad: 3.3 at the rim of the ball
  const ExposureMotion motion = exposure_motion(lines_of(Vec3(1, 0, 0), turn, kNoise, 4));
  ASSERT_TRUE(motion.is_seen);
  const double sign = motion.turn.dot(turn) > 0 ? 1 : -1;
  EXPECT_LT((sign * motion.turn - turn).norm(), 0.2 * turn.norm());
  const Vec3 rim(0, 80, 0);
  EXPECT_LT((sign * motion.way_of(rim) - (Vec3(1, 0, 0) + turn.cross(rim))).norm(), 0.6);
}

TEST(ExposureMotion, TheFitSaysWhatVarianceToExpect) {
  const std::vector<LineBlur> lines = lines_of(Vec3(2, 1, 0), Vec3::Zero(), kNoise, 5);
  std::vector<double> expected;
  static_cast<void>(exposure_motion(lines, 0, &expected));
  ASSERT_EQ(expected.size(), lines.size());
  std::size_t near = 0;
  for (std::size_t i = 0; i < lines.size(); ++i)
    near += std::abs(expected[i] - lines[i].variance_px2) < 3 * kNoise ? 1U : 0U;
  EXPECT_GT(near, lines.size() * 95 / 100);
}

TEST(ExposureMotion, FewLinesOrPairsAreNotJudged) {
  std::vector<LineBlur> lines = lines_of(Vec3(3, 0, 0), Vec3::Zero(), kNoise, 6);
  EXPECT_FALSE(exposure_motion(std::span(lines).first(400)).is_judged);
  std::erase_if(lines, [](const LineBlur& line) { return line.camera > 1; });
  lines.insert(lines.end(), lines.begin(), lines.end());
  EXPECT_FALSE(exposure_motion(lines).is_judged) << "four pairs";
}

TEST(ExposureMotion, SigmaGrowsAcrossTheSurfaceAlone) {
  const Vec3 normal = Vec3::UnitX();
  EXPECT_EQ(motion_sigma({0, 2, 0}, normal, nullptr), 0);
  const double across = motion_sigma({2, 0, 0}, normal, nullptr);
  EXPECT_GT(across, 0);
  EXPECT_NEAR(motion_sigma({4, 0, 0}, normal, nullptr), 2 * across, 1e-12);
  const Vec3 ray = Vec3(1, 1, 0).normalized();
  EXPECT_NEAR(motion_sigma({2, 0, 0}, normal, &ray), across * std::numbers::sqrt2, 1e-12);
}

}  // namespace
}  // namespace pencilscan
