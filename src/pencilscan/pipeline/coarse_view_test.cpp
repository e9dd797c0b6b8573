#include "pencilscan/pipeline/coarse_view.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pencilscan/core/median.h"
#include "pencilscan/pipeline/disagreement_warnings.h"
#include "pencilscan/pipeline/frame_warnings.h"
#include "pencilscan/rig/sample_devices.h"
#include "pencilscan/simulation/panel_light.h"
#include "pencilscan/simulation/render.h"
#include "pencilscan/simulation/simulated_object.h"

namespace pencilscan {
namespace {

constexpr double kBall = 95;

/// Red, green and blue that change evenly over the image.
cv::Mat ramp(int width, int height) {
  cv::Mat image(height, width, CV_32FC3);
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u)
      image.at<cv::Vec3f>(v, u) = {0.01F * static_cast<float>(u), 0.01F * static_cast<float>(v),
                                   0.2F + 0.002F * static_cast<float>(u + v)};
  }
  return image;
}

/// Cameras with `n` times the pixels along a row.
Rig fine_rig(int n) {
  Rig rig = sample::small_rig(480, 360, 110);
  for (Camera& camera : rig.cameras) {
    camera.K.topRows<2>() *= n;
    camera.width = (camera.width - 1) * n + 1;
    camera.height = (camera.height - 1) * n + 1;
  }
  return rig;
}

struct Scene {
  explicit Scene(const Rig& fine) : rig(fine) {}
  /// A ball before such cameras.
  explicit Scene(int n) : rig(fine_rig(n)) {
    const SimulatedObject object(make_sphere(kBall, 96));
    const auto lights = line_lights(rig);
    for (std::size_t c = 0; c < rig.cameras.size(); ++c)
      frame.images.push_back(cv::min(render_camera(rig, c, object, lights), 1.0));
  }
  /// The same as sensors with a mosaic see it.
  void take_mosaics() {
    const auto mosaic = Mosaic::from_name("RGGB");
    for (Camera& camera : rig.cameras) camera.mosaic = mosaic;
    for (cv::Mat& image : frame.images) image = sampled(image, *mosaic);
  }

  Rig rig;
  Frame frame;
};

double distance_median(const FrameResult& result) {
  std::vector<double> off;
  for (const MeasuredPoint& p : result.points.points)
    off.push_back(std::abs(position_of(p).norm() - kBall));
  return upper_median(std::move(off));
}

TEST(CoarseView, MosaicsAndOverexposedPixelsAreJoinedAsTheyAre) {
  Scene scene(fine_rig(4));
  const Camera& camera = scene.rig.cameras.front();
  scene.frame.images.assign(2, ramp(camera.width, camera.height) / 50);
  scene.frame.images.front().at<cv::Vec3f>(48, 96)[1] = 1;
  FrameOptions options;
  options.joined_pixels = 4;
  const auto plain = coarse_view(in_footprints(scene.rig), scene.frame, options);
  scene.take_mosaics();
  const auto mosaic = coarse_view(in_footprints(scene.rig), scene.frame, options);
  ASSERT_TRUE(plain && mosaic);
  EXPECT_FALSE(mosaic->rig.cameras.front().mosaic);
  const cv::Mat& of_plain = plain->frame.images.front();
  const cv::Mat& of_mosaic = mosaic->frame.images.front();
  for (const auto& [u, v] : {std::pair(3, 4), {10, 5}, {11, 20}})
    EXPECT_LT(cv::norm(of_plain.at<cv::Vec3f>(v, u) - of_mosaic.at<cv::Vec3f>(v, u)), 1e-5);
  EXPECT_EQ(of_plain.at<cv::Vec3f>(12, 24)[0], 1);
}

// Crossings miss each other in pixels of the projector, which stay as they are.
TEST(CoarseView, OnlyWhatIsInCameraPixelsIsScaled) {
  const Rig rig = fine_rig(4);
  Frame frame;
  frame.images.resize(rig.cameras.size());
  FrameOptions options;
  options.joined_pixels = 4;
  const auto view = coarse_view(in_footprints(rig), frame, options);
  ASSERT_TRUE(view);
  FrameResult coarse;
  PointResult& points = coarse.points;
  points.detections.resize(rig.cameras.size());
  points.graphs.resize(rig.cameras.size());
  points.crossings = {1000, 0.3, 0.1, {}};
  points.device_crossings.assign(rig.cameras.size() + rig.projectors.size(), {500, 0.6, 0.2, {}});
  points.device_crossings[0].shift_px = Vec2(0.5, -1);
  const Warning said = rig_warning(points.crossings, points.rig_in_frame);
  const Warning named = naming_warning("projector proj0");
  points.warnings = {said, named};
  const PointResult fine = in_fine_pixels(*view, std::move(coarse)).points;
  EXPECT_EQ(fine.crossings.median_px, 0.3);
  EXPECT_EQ(fine.crossings.expected_px, 0.1);
  for (const CrossingDisagreement& of_device : fine.device_crossings) {
    EXPECT_EQ(of_device.median_px, 0.6);
    EXPECT_EQ(of_device.expected_px, 0.2);
  }
  EXPECT_EQ(*fine.device_crossings[0].shift_px, Vec2(2, -4));
  EXPECT_EQ(fine.warnings[0].text, said.text);
  EXPECT_EQ(fine.warnings[1].text, named.text);
}

TEST(CoarseView, JoinedPixelsGiveTheShapeOfLargerOnesAndMorePoints) {
  const Scene home(1);
  Scene scene(4);
  FrameOptions options;
  ASSERT_FALSE(coarse_view(in_footprints(scene.rig), scene.frame, options));
  options.joined_pixels = 4;
  const FrameResult few = reconstruct_frame(home.rig, home.frame);
  for (const bool is_mosaic : {false, true}) {
    if (is_mosaic) scene.take_mosaics();
    const FrameResult many = reconstruct_frame(scene.rig, scene.frame, options);
    EXPECT_GT(many.points.points.size(), 3 * few.points.points.size());
    // Without noise, what a colour's samples miss is all that a mosaic adds.
    EXPECT_LT(distance_median(many), (is_mosaic ? 1.6 : 1.15) * distance_median(few));
    EXPECT_GT(many.shape.surface.report.measured_share,
              few.shape.surface.report.measured_share - 0.02);
    std::vector<double> beside;
    for (const MeasuredPoint& p : many.points.points) {
      const auto pixel = scene.rig.cameras[p.camera].project(position_of(p));
      beside.push_back((*pixel - Vec2(static_cast<double>(p.u), static_cast<double>(p.v))).norm());
      EXPECT_NEAR(std::abs(p.plane - static_cast<float>(p.line)), 0, 0.5);
    }
    EXPECT_LT(upper_median(std::move(beside)), 0.1);
    // Labels lie on the curves as they are written.
    std::size_t labelled = 0;
    for (std::size_t c = 0; c < scene.rig.cameras.size(); ++c) {
      for (const LabeledRun& run : many.points.labeling.runs[c]) {
        const Curve& curve = many.points.graphs[c].curves[static_cast<std::size_t>(run.curve)];
        ASSERT_LE(static_cast<std::size_t>(run.end), curve.points.size());
        ASSERT_LT(run.begin, run.end);
        labelled += static_cast<std::size_t>(run.end - run.begin);
      }
      for (const Curve& curve : many.points.graphs[c].curves)
        for (std::size_t i = 1; i < curve.points.size(); ++i)
          EXPECT_LT((curve.points[i].position - curve.points[i - 1].position).norm(), 2.5);
    }
    EXPECT_GE(labelled, many.points.points.size());
    for (const DepthMap& map : many.shape.depth.maps)
      EXPECT_GE(map.stride * map.columns, scene.rig.cameras.front().width);
  }
}

TEST(WideWindows, FinerPixelsMeasureAsMuchOfTheSurface) {
  const Scene home(1);
  const Scene scene(3);  // lines 29 px apart
  const FrameResult few = reconstruct_frame(home.rig, home.frame);
  const FrameResult many = reconstruct_frame(scene.rig, scene.frame);
  EXPECT_LT(distance_median(many), 1.15 * distance_median(few));  // without noise, no better
  EXPECT_GT(many.shape.surface.report.measured_share,
            few.shape.surface.report.measured_share - 0.02);
}

}  // namespace
}  // namespace pencilscan
