#include "pencilscan/depth/line_blur.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pencilscan/core/random.h"
#include "pencilscan/rig/sample_devices.h"
#include "pencilscan/view/color_family.h"

namespace pencilscan {
namespace {

/// A slanted plane before the small rig: its depth map in the first camera, and that camera's
/// pictures of the first projector's lines, blurred as asked.
class LineBlurTest : public testing::Test {
 protected:
  LineBlurTest() : rig_(sample::small_rig(160, 120, 60)), families_(color_families(rig_)) {
    const Camera& camera = rig_.cameras[0];
    light_.camera = &camera;
    for (std::size_t f = 0; f < families_.size(); ++f) {
      for (const PatternRef& ref : families_[f].patterns) {
        light_.patterns.emplace_back(rig_, camera, ref.projector, ref.pattern);
        light_.patterns.back().set_family(static_cast<int>(f));
      }
    }
    light_.valid = cv::Mat(camera.height, camera.width, CV_8U, cv::Scalar(1));
    light_.sampled.resize(families_.size());
    light_.noise.assign(families_.size(), NoiseModel{kNoise * kNoise, 0});
    light_.blur_px = 0.6F;
    map_.columns = (camera.width - 1) / map_.stride + 1;
    map_.rows = (camera.height - 1) / map_.stride + 1;
    map_.nodes.resize(static_cast<std::size_t>(map_.columns * map_.rows));
    for (std::size_t i = 0; i < map_.nodes.size(); ++i) {
      DepthNode& node = map_.nodes[i];
      const Vec2 pixel = map_.pixel(i);
      node.w = static_cast<float>(inverse_depth(pixel, 0));
      node.wx = static_cast<float>(inverse_depth(pixel + Vec2(0.5, 0), 0) -
                                   inverse_depth(pixel - Vec2(0.5, 0), 0));
      node.wy = static_cast<float>(inverse_depth(pixel + Vec2(0, 0.5), 0) -
                                   inverse_depth(pixel - Vec2(0, 0.5), 0));
      LitPatterns lit;
      for (std::size_t k = 0; k < light_.patterns.size(); ++k) {
        if (light_.patterns[k].projector() == 0) lit.set(k);
      }
      node.lit = map_.lit_sets.place_of(lit);
    }
  }

  /// Of the plane moved by `d` (mm) along its normal.
  [[nodiscard]] double inverse_depth(const Vec2& pixel, double d) const {
    const Camera& camera = rig_.cameras[0];
    const Ray ray = camera.ray(pixel);
    const double way = normal_.dot(d * normal_ - ray.origin) / normal_.dot(ray.direction);
    return 1 / (way * ray.direction.dot(camera.forward()));
  }
  /// Line coordinate that a pixel sees on the plane.
  [[nodiscard]] double coordinate(const Vec2& pixel, double d) const {
    const Camera& camera = rig_.cameras[0];
    const Vec3 x = camera.point_at_depth(pixel, 1 / inverse_depth(pixel, d));
    const LinePattern& pattern = rig_.projectors[0].patterns[0];
    return pattern.coordinate(
        (*rig_.projectors[0].project(x))[static_cast<Eigen::Index>(pattern.axis)]);
  }

  /// Pictures of the plane while it goes `way` (mm) along its normal; the blur of lens and
  /// projector has this deviation, px.
  void take_pictures(double blur_px, double way) {
    constexpr int kMoments = 24;
    const LinePattern& pattern = rig_.projectors[0].patterns[0];
    const double half = 0.5 * pattern.line_width_px / pattern.pitch_px;
    Random random(7);
    light_.families.assign(families_.size(), cv::Mat::zeros(light_.valid.size(), CV_32F));
    for (cv::Mat& picture : light_.families) {
      picture = picture.clone();
      for (int v = 0; v < picture.rows; ++v) {
        for (int u = 0; u < picture.cols; ++u) {
          const Vec2 pixel(u, v);
          const Vec2 slope(
              coordinate(pixel + Vec2(0.5, 0), 0) - coordinate(pixel - Vec2(0.5, 0), 0),
              coordinate(pixel + Vec2(0, 0.5), 0) - coordinate(pixel - Vec2(0, 0.5), 0));
          const double s = blur_px * slope.norm() * std::sqrt(2.0);
          double light = 0;
          for (int k = 0; k < kMoments; ++k) {
            const double l = coordinate(pixel, way * ((k + 0.5) / kMoments - 0.5));
            for (int n = -1; n <= 1; ++n) {
              const double o = l - std::round(l) - n;
              light += 0.5 * (std::erf((o + half) / s) - std::erf((o - half) / s)) / kMoments;
            }
          }
          picture.at<float>(v, u) =
              static_cast<float>(0.05 + 0.6 * light + random.normal(0, kNoise));
        }
      }
    }
  }

  [[nodiscard]] std::vector<NodeLines> measured() const {
    std::vector<NodeLines> lines = lines_at_nodes(rig_, light_, map_, 1);
    for (int round = 0; round < 3; ++round) measure_blurs(light_, map_, 5, lines);
    std::erase_if(lines, [](const NodeLines& l) { return !std::isfinite(l.blur.deviation_px2); });
    return lines;
  }

  static constexpr float kNoise = 0.004F;
  Rig rig_;
  std::vector<ColorFamily> families_;
  Vec3 normal_ = Vec3(0.9, 0.2, 0.3).normalized();
  CameraLight light_;
  DepthMap map_;
};

TEST_F(LineBlurTest, ALineGoesOverThePictureAsThePlaneGoesThroughItsSheet) {
  const std::vector<NodeLines> lines = lines_at_nodes(rig_, light_, map_, 2);
  ASSERT_GT(lines.size(), 50U);
  constexpr double kWay = 0.01;  // mm
  for (const NodeLines& entry : lines) {
    const Vec2 pixel = map_.pixel(entry.node);
    const double change = (coordinate(pixel, kWay) - coordinate(pixel, -kWay)) / (2 * kWay);
    const Vec2 slope(coordinate(pixel + Vec2(0.5, 0), 0) - coordinate(pixel - Vec2(0.5, 0), 0),
                     coordinate(pixel + Vec2(0, 0.5), 0) - coordinate(pixel - Vec2(0, 0.5), 0));
    const double expected = std::abs(change) / slope.norm();
    // The map holds single precision.
    EXPECT_NEAR(entry.blur.px_per_length, expected, 1e-3 * expected);
    EXPECT_NEAR(entry.blur.px_per_line, 1 / slope.norm(), 1e-3 / slope.norm());
    EXPECT_NEAR(std::abs(entry.blur.normal.dot(normal_)), 1, 1e-5);
  }
}

TEST_F(LineBlurTest, BlurIsMeasuredAsItIs) {
  for (const double blur : {0.5, 0.7, 1.0}) {
    take_pictures(blur, 0);
    const std::vector<NodeLines> lines = measured();
    ASSERT_GT(lines.size(), 200U);
    double mean = 0;
    for (const NodeLines& entry : lines)
      mean += entry.blur.variance_px2 / static_cast<double>(lines.size());
    EXPECT_NEAR(mean, blur * blur, 0.02 * blur * blur) << blur;
  }
}

TEST_F(LineBlurTest, MotionAddsATwelfthOfItsSquare) {
  constexpr double kBlur = 0.7;
  constexpr double kWay = 1.2;  // mm
  take_pictures(kBlur, kWay);
  const std::vector<NodeLines> lines = measured();
  ASSERT_GT(lines.size(), 200U);
  double seen = 0;
  double expected = 0;
  for (const NodeLines& entry : lines) {
    const double moved = entry.blur.px_per_length * kWay;
    seen += entry.blur.variance_px2 - kBlur * kBlur;
    expected += moved * moved / 12;
  }
  EXPECT_GT(expected / static_cast<double>(lines.size()), 0.02);
  EXPECT_NEAR(seen, expected, 0.1 * expected);
}

}  // namespace
}  // namespace pencilscan
