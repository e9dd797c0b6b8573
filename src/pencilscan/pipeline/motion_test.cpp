// Motion within the exposure: a ball that rests or moves while the shutters are open.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "pencilscan/pipeline/frame.h"
#include "pencilscan/pipeline/sample_frame.h"
#include "pencilscan/planning/ring.h"

namespace pencilscan {
namespace {

constexpr double kRadius = 90;  // mm
constexpr int kSegments = 256;  // facets lie 0.007 mm within the ball, far below sigma

Rig small_ring() {
  RingOptions options;
  options.camera_width = 640;
  options.camera_height = 480;
  options.camera_focal_px = 1600;
  options.volume_radius_mm = 110;
  return make_ring(options);
}

Frame frame_of(const Rig& rig, const Vec3& shift) {
  const auto moments =
      through_exposure(make_sphere(kRadius, kSegments), {}, {}, {.shift = shift}, footprint(rig));
  PhotographyOptions photo;
  photo.noise = "medium";
  photo.render.samples = 1;
  return sample::photographed_frame(rig, moments, photo);
}

FrameResult result_of(const Vec3& shift) {
  const Rig rig = small_ring();
  return reconstruct_frame(rig, frame_of(rig, shift));
}

bool warns(const FrameResult& result) {
  return std::any_of(result.points.warnings.begin(), result.points.warnings.end(),
                     [](const Warning& w) { return w.code == WarningCode::kMotion; });
}

/// Shares of the points that lie within one and two sigma of the ball, along their rays, where the
/// middle of the exposure has it.
std::pair<double, double> coverage(const FrameResult& result) {
  const Rig rig = small_ring();
  std::size_t one = 0;
  std::size_t two = 0;
  std::size_t all = 0;
  for (const MeasuredPoint& p : result.points.points) {
    const Vec3 x = position_of(p);
    const Vec3 ray = (x - rig.cameras[p.camera].center()).normalized();
    const double cosine = std::max(0.2, std::abs(ray.dot(x.normalized())));
    const double off = std::abs(x.norm() - kRadius) / cosine / static_cast<double>(p.sigma);
    one += off < 1 ? 1U : 0U;
    two += off < 2 ? 1U : 0U;
    ++all;
  }
  return {static_cast<double>(one) / static_cast<double>(all),
          static_cast<double>(two) / static_cast<double>(all)};
}

TEST(MotionInExposure, WhatRestsIsLeftAlone) {
  const FrameResult result = result_of(Vec3::Zero());
  EXPECT_TRUE(result.shape.motion.is_judged);
  EXPECT_FALSE(result.shape.motion.is_seen);
  EXPECT_FALSE(warns(result));
  EXPECT_LT(result.shape.motion.at_most, 1.2);
}

TEST(MotionInExposure, AShiftIsMeasuredAndCounted) {
  for (const Vec3& shift : {Vec3(1.5, -1, 0.5), Vec3(1, 1.5, -2)}) {
    const FrameResult result = result_of(shift);
    const ExposureMotion& motion = result.shape.motion;
    ASSERT_TRUE(motion.is_seen) << shift.transpose();
    EXPECT_TRUE(warns(result));
    const double sign = motion.shift.dot(shift) > 0 ? 1 : -1;
    EXPECT_LT((sign * motion.shift - shift).norm(), 0.2 * shift.norm()) << motion.shift.transpose();
    EXPECT_NEAR(motion.way, shift.norm(), 0.15 * shift.norm());
    EXPECT_GE(motion.at_most, 0.9 * shift.norm());
    const auto [one, two] = coverage(result);
    EXPECT_GT(one, 0.62);
    EXPECT_GT(two, 0.92);
  }
}

// Windows of a mosaic are wider than those beside it.
TEST(MotionInExposure, TheOrderOfCamerasDoesNotMatter) {
  Rig rig = small_ring();
  Frame frame = frame_of(rig, Vec3::Zero());
  for (std::size_t c = 0; c < rig.cameras.size(); c += 2) {
    rig.cameras[c].mosaic = Mosaic::from_name("RGGB");
    frame.images[c] = sampled(frame.images[c], *rig.cameras[c].mosaic);
  }
  rig = in_footprints(rig);
  const PointResult points = sample::points_in_footprints(rig, frame);
  const DepthStageOptions options;
  DepthResult depth =
      measure_depth(rig, points.families, frame.images, points.detections, points.points, options);
  const ExposureMotion motion = motion_in_exposure(rig, options, depth);
  ASSERT_TRUE(motion.is_judged);
  std::reverse(depth.maps.begin(), depth.maps.end());
  std::reverse(depth.lights.begin(), depth.lights.end());
  constexpr double kRounding = 1e-6;  // of sums in another order
  EXPECT_NEAR(motion_in_exposure(rig, options, depth).at_most, motion.at_most,
              kRounding * motion.at_most);
}

}  // namespace
}  // namespace pencilscan
