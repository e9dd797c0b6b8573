#include "pencilscan/pipeline/coarse_view.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pencilscan/core/median.h"
#include "pencilscan/rig/object_space.h"
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

TEST(Binned, PixelsStandForThoseAroundTheirPlace) {
  const cv::Mat image = ramp(41, 31);
  for (const int n : {2, 3, 4}) {
    const cv::Mat means = binned(image, n);
    ASSERT_EQ(means.size(), cv::Size(40 / n + 1, 30 / n + 1));
    for (int v = 1; v < 30 / n; ++v) {
      for (int u = 1; u < 40 / n; ++u)
        EXPECT_LT(cv::norm(means.at<cv::Vec3f>(v, u) - image.at<cv::Vec3f>(n * v, n * u)), 1e-5);
    }
  }
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

/// A ball before cameras with `n` times the pixels along a row.
struct Scene {
  explicit Scene(int n) : rig(sample::small_rig(480, 360, 110)) {
    for (Camera& camera : rig.cameras) {
      camera.K.topRows<2>() *= n;
      camera.width = (camera.width - 1) * n + 1;
      camera.height = (camera.height - 1) * n + 1;
    }
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
  Scene scene(4);
  scene.frame.images.front() = ramp(scene.rig.cameras[0].width, scene.rig.cameras[0].height) / 50;
  scene.frame.images.front().at<cv::Vec3f>(48, 96)[1] = 1;
  const auto plain = coarse_view(in_footprints(scene.rig), scene.frame, {});
  scene.take_mosaics();
  const auto mosaic = coarse_view(in_footprints(scene.rig), scene.frame, {});
  ASSERT_TRUE(plain && mosaic);
  const int n = plain->binning.front();
  ASSERT_TRUE(n == 3 || n == 4);
  EXPECT_FALSE(mosaic->rig.cameras.front().mosaic);
  const cv::Mat& of_plain = plain->frame.images.front();
  const cv::Mat& of_mosaic = mosaic->frame.images.front();
  for (const auto& [u, v] : {std::pair(3, 4), {10, 5}, {11, 20}})
    EXPECT_LT(cv::norm(of_plain.at<cv::Vec3f>(v, u) - of_mosaic.at<cv::Vec3f>(v, u)), 1e-5);
  EXPECT_EQ(of_plain.at<cv::Vec3f>(48 / n, 96 / n)[0], 1);  // n divides both
}

TEST(CoarseView, MorePixelsGiveTheSameShapeAndMorePoints) {
  const Scene home(1);
  ASSERT_FALSE(coarse_view(in_footprints(home.rig), home.frame, {}));
  Scene scene(4);
  const auto view = coarse_view(in_footprints(scene.rig), scene.frame, {});
  ASSERT_TRUE(view);
  EXPECT_EQ(view->binning.front(),
            std::lround(line_spacing(scene.rig) / footprint(scene.rig) / 10));
  const FrameResult few = reconstruct_frame(home.rig, home.frame);
  for (const bool is_mosaic : {false, true}) {
    if (is_mosaic) scene.take_mosaics();
    const FrameResult many = reconstruct_frame(scene.rig, scene.frame);
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

}  // namespace
}  // namespace pencilscan
