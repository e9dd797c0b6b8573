#include "pencilscan/depth/depth.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "pencilscan/core/parallel.h"
#include "pencilscan/core/random.h"
#include "pencilscan/depth/depth_image.h"
#include "pencilscan/depth/pruning.h"
#include "pencilscan/depth/seeds.h"
#include "pencilscan/rig/camera_light.h"
#include "pencilscan/rig/sample_devices.h"
#include "pencilscan/simulation/panel_light.h"
#include "pencilscan/simulation/render.h"
#include "pencilscan/simulation/sensor.h"
#include "pencilscan/simulation/simulated_object.h"
#include "pencilscan/simulation/truth.h"

namespace pencilscan {
namespace {

/// Before a ball, small images.
Rig small_rig() { return sample::small_rig(240, 200, 70); }

/// Images of a ball with noise, true depth, and points on it as labelled curves would give them.
struct BallScene {
  BallScene() : rig(small_rig()), families(color_families(rig)) {
    const SimulatedObject object(make_sphere(42, 96));
    const auto lights = line_lights(rig);
    SensorOptions sensor;
    sensor.blur_px = 0.6;
    sensor.full_well = 6000;
    sensor.read_noise = 1.5;
    sensor.bit_depth = 16;
    Random random(5);
    for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
      const cv::Mat raw = apply_sensor(render_camera(rig, c, object, lights), sensor, 1,
                                       static_cast<std::uint32_t>(c));
      cv::Mat image;
      raw.convertTo(image, CV_32FC3, 1.0 / 65535);
      images.push_back(image);
      truth.push_back(camera_truth(rig, c, object));
      add_points(c, random);
    }
    detections.resize(rig.cameras.size());
    see();
  }

  /// The light of the families in the pictures.
  void see() {
    for (std::size_t c = 0; c < images.size(); ++c) {
      const Camera& camera = rig.cameras[c];
      detections[c].presence.clear();
      const cv::Mat light =
          projector_light(camera, linear_light(camera, images[c]), detections[c].unmixing);
      for (const ColorFamily& family : families)
        detections[c].presence.push_back(presence_image(light, family));
    }
  }

  /// Every pixel within half a pixel of a line.
  void add_points(std::size_t c, Random& random) {
    const Camera& camera = rig.cameras[c];
    for (int v = 1; v + 1 < camera.height; ++v) {
      for (int u = 1; u + 1 < camera.width; ++u) {
        const double z = truth[c].depth.at<double>(v, u);
        if (!std::isfinite(z) || truth[c].cosine.at<float>(v, u) < 0.3F) continue;
        for (std::size_t p = 0; p < 2; ++p) {
          const ProjectorTruth& light = truth[c].projectors[p];
          if (light.lit.at<std::uint8_t>(v, u) == 0) continue;
          const double line = light.line[0].at<double>(v, u);
          const double dx = light.line[0].at<double>(v, u + 1) - line;
          const double dy = light.line[0].at<double>(v + 1, u) - line;
          if (!(std::abs(line - std::round(line)) < 0.5 * std::hypot(dx, dy))) continue;
          MeasuredPoint point;
          set_position(camera.point_at_depth(Vec2(u, v), z + random.normal(0, 0.1)), point);
          point.u = static_cast<float>(u);
          point.v = static_cast<float>(v);
          point.camera = static_cast<std::uint8_t>(c);
          point.projector = static_cast<std::uint8_t>(p);
          point.line = static_cast<std::uint16_t>(std::lround(line));
          point.sigma = 0.1F;
          point.confidence = 1;
          points.push_back(point);
        }
      }
    }
  }

  [[nodiscard]] DepthResult measure(const DepthStageOptions& options = {}) const {
    return measure_depth(rig, families, images, detections, points, options);
  }

  /// Signed depth error of every measured node whose pixel sees the ball.
  [[nodiscard]] std::vector<double> errors(const DepthMap& map) const {
    std::vector<double> errors;
    for (std::size_t i = 0; i < map.nodes.size(); ++i) {
      if (!map.nodes[i].measured()) continue;
      const Vec2 pixel = map.pixel(i);
      const double z = truth[static_cast<std::size_t>(map.camera)].depth.at<double>(
          static_cast<int>(pixel[1]), static_cast<int>(pixel[0]));
      if (std::isfinite(z)) errors.push_back(1 / static_cast<double>(map.nodes[i].w) - z);
    }
    return errors;
  }

  Rig rig;
  std::vector<ColorFamily> families;
  std::vector<cv::Mat> images;
  std::vector<CameraTruth> truth;
  std::vector<MeasuredPoint> points;
  std::vector<CameraDetection> detections;
};

const BallScene& ball_scene() {
  static const BallScene scene;
  return scene;
}

double median_size(std::vector<double> values) {
  for (double& v : values) v = std::abs(v);
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

TEST(PatternView, LineCoordinateIsThatOfTheRayInTheProjector) {
  Rig rig = small_rig();
  rig.cameras[0].distortion = {-0.1, 0.02, 0.001, -0.001, 0};
  rig.projectors[0].distortion = {-0.08, 0.01, 0.0005, 0.001, 0};
  const Camera& camera = rig.cameras[0];
  const PatternView view(rig, camera, 0, 0);
  const Vec2 pixel(130, 90);
  constexpr double kDepth = 540;
  const Vec2 m = camera.normalized_from_pixel(pixel);
  Eigen::Matrix2d jacobian;
  jacobian.col(0) = camera.normalized_from_pixel(pixel + Vec2(0.5, 0)) -
                    camera.normalized_from_pixel(pixel - Vec2(0.5, 0));
  jacobian.col(1) = camera.normalized_from_pixel(pixel + Vec2(0, 0.5)) -
                    camera.normalized_from_pixel(pixel - Vec2(0, 0.5));
  bool ok = false;
  const WindowLines lines = view.lines(m, jacobian, 1 / kDepth, ok);
  ASSERT_TRUE(ok);
  const LinePattern& pattern = rig.projectors[0].patterns[0];
  // Lenses are linearised over the window: what is left is of second order, here below 1e-3 lines.
  for (const double depth : {538.0, 540.0, 542.0}) {
    for (const double d : {-5.0, 0.0, 5.0}) {
      const auto exact =
          RayInProjector(camera, rig.projectors[0], pixel + Vec2(d, -d)).pixel(depth);
      const auto f = static_cast<float>(d);
      EXPECT_NEAR(lines.line(f, -f, static_cast<float>(1 / depth)), pattern.coordinate((*exact)[0]),
                  1e-3);
    }
  }
}

TEST(Seeds, TwoSurfacesGiveTwoPlanes) {
  const Rig rig = small_rig();
  const Camera& camera = rig.cameras[0];
  std::vector<MeasuredPoint> points;
  for (int i = -8; i <= 8; ++i) {
    for (const int column : {-4, 4}) {
      const Vec2 pixel(100 + column, 100 + i);
      const Vec3 x = camera.point_at_depth(pixel, column < 0 ? 500 : 530);
      MeasuredPoint p;
      set_position(x, p);
      p.u = static_cast<float>(pixel.x());
      p.v = static_cast<float>(pixel.y());
      p.sigma = 0.1F;
      points.push_back(p);
    }
  }
  const CurveSeeds seeds(camera, 0, points);
  const auto planes = seeds.planes(Vec2(98, 100), 9, 5);
  ASSERT_EQ(planes.size(), 2u);
  EXPECT_NEAR(1 / planes[0][0], 500, 0.5);  // the nearer one in the image first
  EXPECT_NEAR(1 / planes[1][0], 530, 3);
  EXPECT_TRUE(seeds.planes(Vec2(20, 20), 9, 5).empty());
}

TEST(DenseDepth, BallIsDenseAndAccurate) {
  const BallScene& scene = ball_scene();
  const DepthResult result = scene.measure();
  ASSERT_EQ(result.maps.size(), 2u);
  for (const DepthMap& map : result.maps) {
    std::size_t visible = 0;
    for (std::size_t i = 0; i < map.nodes.size(); ++i) {
      const Vec2 pixel = map.pixel(i);
      const CameraTruth& truth = scene.truth[static_cast<std::size_t>(map.camera)];
      const int u = static_cast<int>(pixel[0]);
      const int v = static_cast<int>(pixel[1]);
      if (!(truth.cosine.at<float>(v, u) > 0.3F)) continue;
      for (const ProjectorTruth& p : truth.projectors) {
        if (p.lit.at<std::uint8_t>(v, u) == 0 || p.cosine.at<float>(v, u) < 0.3F) continue;
        ++visible;
        break;
      }
    }
    const std::vector<double> errors = scene.errors(map);
    EXPECT_GT(errors.size(), visible * 9 / 10);
    // A pixel is 0.6 mm wide here: a tenth of it, against points with 0.1 mm of noise.
    EXPECT_LT(median_size(errors), 0.06);
    const auto gross =
        std::count_if(errors.begin(), errors.end(), [](double e) { return std::abs(e) > 1; });
    // At the rim of so small an image, where windows look past the ball.
    EXPECT_LT(static_cast<double>(gross), 0.02 * static_cast<double>(errors.size()));
  }
}

TEST(DenseDepth, ASurfaceNearbyGivesDepthBackAndOneThatIsOffDoesNot) {
  const BallScene& scene = ball_scene();
  DepthResult result = scene.measure();
  DepthMap& map = result.maps[0];
  std::vector<std::size_t> hole;
  for (std::size_t i = 0; i < map.nodes.size(); ++i) {
    if (!map.nodes[i].measured() || (map.pixel(i) - Vec2(125, 100)).norm() > 20) continue;
    map.nodes[i] = DepthNode{};
    hole.push_back(i);
  }
  ASSERT_GT(hole.size(), 30u);
  const auto found_of_hole = [&](double radius_mm) {
    DepthResult completed = result;
    guided_depth(scene.rig, RayScene(make_sphere(radius_mm, 96)), {}, {}, completed);
    std::size_t found = 0;
    for (const std::size_t i : hole) {
      const DepthNode& node = completed.maps[0].nodes[i];
      if (!node.measured()) continue;
      ++found;
      const Vec2 pixel = map.pixel(i);
      const double z =
          scene.truth[0].depth.at<double>(static_cast<int>(pixel[1]), static_cast<int>(pixel[0]));
      EXPECT_NEAR(1 / static_cast<double>(node.w), z, 0.5);
      EXPECT_GT(node.sigma, 0);
      EXPECT_GT(node.confidence, 0);
    }
    return found;
  };
  EXPECT_GE(found_of_hole(42.3), hole.size() * 9 / 10);
  EXPECT_EQ(found_of_hole(45), 0u);
}

TEST(DenseDepth, WindowsHoldAWholeLine) {
  CameraLight light;
  light.spacing_px = 11.4F;
  light.line_px = 3.8F;
  const DepthOptions usual = options_for(light, {});
  EXPECT_EQ(usual.half, DepthOptions{}.half);
  EXPECT_EQ(usual.stride, DepthOptions{}.stride);
  light.spacing_px = 24.5F;
  light.line_px = 8.2F;
  const DepthOptions wide = options_for(light, {});
  EXPECT_EQ(wide.half, 8);
  EXPECT_EQ(wide.stride, 6);  // even: wider windows beside these join 2 x 2 pixels
  light.of_mosaic = true;
  EXPECT_EQ(options_for(light, {}).half, 8);
  EXPECT_EQ(options_for(light, {}).narrow_half, 8);
  light.line_px = 30;
  EXPECT_EQ(options_for(light, {}).half, 10);
  EXPECT_LE(options_for(light, {}).stride, 8);
}

TEST(DenseDepth, NarrowWindowsMeasureWhereWideOnesDoNotFit) {
  CameraLight mosaic;
  mosaic.spacing_px = 11.4F;
  mosaic.line_px = 3.8F;
  mosaic.of_mosaic = true;
  EXPECT_EQ(options_for(mosaic, {}).half, 6);
  EXPECT_EQ(options_for(mosaic, {}).narrow_half, 5);

  // Beside the rim of so small a ball.
  const BallScene& scene = ball_scene();
  const DepthResult measured = scene.measure();
  const auto depth = [&](int narrow_half) {
    DepthOptions options;
    options.half = 10;
    options.narrow_half = narrow_half;
    return dense_depth(measured.lights[0], 0, scene.points, {ObjectSpace(scene.rig), {}}, options);
  };
  const DepthMap wide = depth(10);
  DepthMap both = depth(5);
  std::size_t added = 0;
  for (std::size_t i = 0; i < both.nodes.size(); ++i) {
    if (wide.nodes[i].measured()) {
      EXPECT_TRUE(both.nodes[i].measured());
      both.nodes[i] = DepthNode{};
    } else if (both.nodes[i].measured()) {
      ++added;
    }
  }
  EXPECT_GT(added, 20u);
  EXPECT_LT(median_size(scene.errors(both)), 0.6);  // a pixel, where the ball turns away
}

TEST(DenseDepth, BlurIsFound) {
  const DepthResult result = ball_scene().measure();
  ASSERT_EQ(result.report.cameras.size(), ball_scene().rig.cameras.size());
  // Sensor 0.6 px and the pixel's own box, 0.29 px.
  for (const CameraDepthReport& camera : result.report.cameras)
    EXPECT_NEAR(camera.blur_px, std::hypot(0.6, 0.29), 0.12);
}

// A camera may see so little that two projectors light that none of its lines has a name.
TEST(DenseDepth, ACameraWithoutLabelsSeesItsBlurAndDepthOnTheSurfaceOfOthers) {
  BallScene scene = ball_scene();
  const std::size_t nodes = scene.measure().report.cameras[1].measured;
  std::erase_if(scene.points, [](const MeasuredPoint& p) { return p.camera == 1; });
  const DepthResult without = scene.measure();
  ASSERT_EQ(without.report.cameras[1].measured, 0U);
  TriangleMesh surface = make_sphere(42.2, 96);
  const auto guided = [&](float confidence) {
    surface.confidence.assign(surface.vertices.size(), confidence);
    DepthResult result = without;
    guided_depth(scene.rig, RayScene(surface), {}, {}, result);
    return result;
  };
  EXPECT_LT(guided(0).report.cameras[1].measured, nodes / 10);  // nobody measured the surface
  const DepthResult result = guided(1);
  EXPECT_GT(result.report.cameras[1].measured, nodes * 9 / 10);
  EXPECT_NEAR(result.report.cameras[1].blur_px, std::hypot(0.6, 0.29), 0.2);
  EXPECT_LT(median_size(scene.errors(result.maps[1])), 0.06);
}

TEST(DenseDepth, SigmaTellsTheError) {
  const BallScene& scene = ball_scene();
  std::size_t below_one = 0;
  std::size_t below_two = 0;
  std::size_t count = 0;
  const DepthResult result = scene.measure();
  for (const DepthMap& map : result.maps) {
    for (std::size_t i = 0; i < map.nodes.size(); ++i) {
      if (!map.nodes[i].measured()) continue;
      const Vec2 pixel = map.pixel(i);
      const double z = scene.truth[static_cast<std::size_t>(map.camera)].depth.at<double>(
          static_cast<int>(pixel[1]), static_cast<int>(pixel[0]));
      if (!std::isfinite(z)) continue;
      const double error = std::abs(1 / static_cast<double>(map.nodes[i].w) - z);
      const auto sigma = static_cast<double>(map.nodes[i].sigma);
      below_one += error < sigma ? 1 : 0;
      below_two += error < 2 * sigma ? 1 : 0;
      ++count;
    }
  }
  // 0.68 and 0.95 for a normal distribution; the rim of this small image has a heavier tail.
  const double share = static_cast<double>(below_one) / static_cast<double>(count);
  EXPECT_GT(share, 0.58);
  EXPECT_LT(share, 0.80);
  EXPECT_GT(static_cast<double>(below_two), 0.82 * static_cast<double>(count));
}

TEST(DepthImage, NodesAreInTheirPixelsAndHolesAreNaN) {
  const BallScene& scene = ball_scene();
  const DepthMap map = scene.measure().maps[0];
  const DepthImage image = depth_image(scene.rig.cameras[0], map);
  std::size_t measured = 0;
  for (std::size_t i = 0; i < map.nodes.size(); ++i) {
    const Vec2 pixel = map.pixel(i);
    const float z = image.depth.at<float>(static_cast<int>(pixel[1]), static_cast<int>(pixel[0]));
    if (map.nodes[i].measured()) {
      EXPECT_FLOAT_EQ(z, 1 / map.nodes[i].w);
      ++measured;
    } else {
      EXPECT_TRUE(std::isnan(z));
    }
  }
  EXPECT_GT(measured, 500U);
  EXPECT_LT(measured, map.nodes.size());
}

TEST(DenseDepth, SameBytesForAnyThreadCount) {
  const BallScene& scene = ball_scene();
  std::vector<DepthResult> results;
  for (const int threads : {1, 3}) {
    const ThreadLimit limit(threads);
    results.push_back(scene.measure());
  }
  ASSERT_EQ(results[0].maps.size(), scene.rig.cameras.size());
  ASSERT_EQ(results[1].maps.size(), results[0].maps.size());
  for (std::size_t m = 0; m < results[0].maps.size(); ++m) {
    for (std::size_t i = 0; i < results[0].maps[m].nodes.size(); ++i) {
      const DepthNode& a = results[0].maps[m].nodes[i];
      const DepthNode& b = results[1].maps[m].nodes[i];
      ASSERT_EQ(a.w, b.w);
      ASSERT_EQ(a.sigma, b.sigma);
      ASSERT_EQ(a.confidence, b.confidence);
    }
  }
}

TEST(DenseDepth, NoPointsAndNoImagesGiveNoDepth) {
  const BallScene& scene = ball_scene();
  const DepthResult none =
      measure_depth(scene.rig, scene.families, scene.images, scene.detections, {});
  for (const DepthMap& map : none.maps) {
    for (const DepthNode& node : map.nodes) EXPECT_FALSE(node.measured());
  }
  const std::vector<cv::Mat> missing(2);
  EXPECT_TRUE(measure_depth(scene.rig, scene.families, missing, scene.detections, scene.points)
                  .maps.empty());
}

TEST(Consistency, FloatingPatchIsRemovedAndUnconfirmedDepthStays) {
  const BallScene& scene = ball_scene();
  DepthResult result = scene.measure();
  DepthMap& first = result.maps[0];
  // A patch of the first camera, 6 mm nearer than the ball: the second camera looks through it.
  std::vector<std::size_t> patch;
  std::size_t before = 0;
  for (std::size_t i = 0; i < first.nodes.size(); ++i) {
    DepthNode& node = first.nodes[i];
    before += node.measured() ? 1 : 0;
    if (!node.measured() || (first.pixel(i) - Vec2(125, 100)).norm() > 20) continue;
    node.w = static_cast<float>(1 / (1 / static_cast<double>(node.w) - 6));
    patch.push_back(i);
  }
  ASSERT_GT(patch.size(), 30u);
  const std::vector<int> projectors = {0, 1};
  const ConsistencyReport report = check_consistency(scene.rig, projectors, result.maps);
  EXPECT_GE(report.contradicted + report.islands, patch.size() * 9 / 10);
  std::size_t left = 0;
  for (const std::size_t i : patch) left += first.nodes[i].measured() ? 1 : 0;
  EXPECT_LE(left, patch.size() / 10);
  std::size_t after = 0;
  for (const DepthNode& node : first.nodes) after += node.measured() ? 1 : 0;
  EXPECT_GE(after, (before - patch.size()) * 95 / 100);
  // One camera alone: nobody confirms it, all of it stays.
  std::vector<DepthMap> alone = {ball_scene().measure().maps[1]};
  EXPECT_LT(check_consistency(scene.rig, projectors, alone).contradicted, 5u);
}

/// A flat map, parallel to the image, of a camera that looks at the origin: all of it at one depth.
DepthMap flat_map(const Rig& rig, int camera, double depth) {
  const Camera& device = rig.cameras[static_cast<std::size_t>(camera)];
  DepthMap map;
  map.camera = camera;
  map.columns = device.width / map.stride;
  map.rows = device.height / map.stride;
  DepthNode node;
  node.w = static_cast<float>(1 / depth);
  node.sigma = 0.05F;
  node.seeded = true;
  node.reason = HoleReason::kMeasured;
  map.nodes.assign(static_cast<std::size_t>(map.columns * map.rows), node);
  return map;
}

TEST(Consistency, TheTwoSidesOfASheetDoNotDisagree) {
  constexpr double kThickness = 1;  // less than what lies at one place
  Rig rig = small_rig();
  const auto factor = [&](const Vec3& second_eye, double second_depth) {
    rig.cameras[0] = sample::device_at<Camera>({600, 0, 0}, "cam0", 240, 200, 900);
    rig.cameras[1] = sample::device_at<Camera>(second_eye, "cam1", 240, 200, 900);
    std::vector<DepthMap> maps{flat_map(rig, 0, 600 - kThickness / 2),
                               flat_map(rig, 1, second_depth)};
    const std::vector<int> projectors = {0, 1};
    return check_consistency(rig, projectors, maps).sigma_factor;
  };
  EXPECT_LT(factor({-600, 0, 0}, 600 - kThickness / 2), 2);
  // From the same side, one of them is wrong by as much.
  EXPECT_GT(factor({600, 0, 0}, 600 + kThickness / 2), 4);
}

TEST(Consistency, ShadowsAreTheSameHoweverFineTheProjectorsPixelsAre) {
  const BallScene& scene = ball_scene();
  const std::vector<int> projectors = {0, 1};
  std::vector<std::size_t> contradicted;
  for (const double finer : {1.0, 0.2, 5.0}) {
    Rig rig = scene.rig;
    for (Projector& projector : rig.projectors) {
      projector.width = static_cast<int>(projector.width * finer);
      projector.height = static_cast<int>(projector.height * finer);
      projector.K.topRows<2>() *= finer;
      for (LinePattern& pattern : projector.patterns) pattern.pitch_px *= finer;
    }
    std::vector<DepthMap> maps = scene.measure().maps;
    contradicted.push_back(check_consistency(rig, projectors, maps).contradicted);
  }
  EXPECT_LE(contradicted[1], contradicted[0] + 20);
  EXPECT_LE(contradicted[2], contradicted[0] + 20);
}

/// How many nodes around the middle of the ball one camera alone keeps after change(node,
/// is_around) of every measured one, and of how many.
template <class Change>
std::pair<std::size_t, std::size_t> kept_of_patch(Change change) {
  const BallScene& scene = ball_scene();
  std::vector<DepthMap> maps = {scene.measure().maps[0]};
  std::vector<std::size_t> patch;
  for (std::size_t i = 0; i < maps[0].nodes.size(); ++i) {
    DepthNode& node = maps[0].nodes[i];
    if (!node.measured()) continue;
    const bool is_around = (maps[0].pixel(i) - Vec2(125, 100)).norm() <= 20;
    change(maps[0], node, is_around);
    if (is_around) patch.push_back(i);
  }
  const std::vector<int> projectors = {0, 1};
  static_cast<void>(check_consistency(scene.rig, projectors, maps));
  std::size_t left = 0;
  for (const std::size_t i : patch) left += maps[0].nodes[i].measured() ? 1 : 0;
  return {left, patch.size()};
}

/// With one camera nobody contradicts: a patch may stay where a labelled curve started it, and not
/// where growth slipped there.
template <class Change>
void expect_only_a_seeded_patch_stays(Change change) {
  for (const bool seeded : {true, false}) {
    const auto [left, size] = kept_of_patch([&](DepthMap& map, DepthNode& node, bool is_around) {
      change(map, node, is_around);
      if (is_around) node.seeded = seeded;
    });
    ASSERT_GT(size, 30u);
    if (seeded) {
      EXPECT_GT(left, size * 9 / 10);
    } else {
      EXPECT_EQ(left, 0U);
    }
  }
}

TEST(Consistency, IslandsThatOnlyGrewAreRemoved) {
  // 6 mm behind the rest: a surface of its own.
  expect_only_a_seeded_patch_stays([](DepthMap&, DepthNode& node, bool is_around) {
    if (is_around) node.w = static_cast<float>(1 / (1 / static_cast<double>(node.w) + 6));
  });
}

TEST(Consistency, PatchesOfOneProjectorNeedACurveOrAnotherView) {
  // It continues the rest, but shows the lines of one projector only.
  expect_only_a_seeded_patch_stays([](DepthMap& map, DepthNode& node, bool is_around) {
    node.lit = map.lit_sets.place_of(is_around ? 1 : 3);
  });
}

TEST(Pruning, GuidedNodesOfOneProjectorContinueIntoThreeNeighbors) {
  DepthMap map;
  map.columns = map.rows = 5;
  map.nodes.resize(25);
  const auto measure = [&](int row, int column, float z) -> DepthNode& {
    DepthNode& node = map.nodes[map.index(row, column)];
    node.w = 1 / z;
    node.sigma = 0.05F;
    node.lit = map.lit_sets.place_of(1);
    return node;
  };
  for (int row = 0; row < 2; ++row)
    for (int column = 0; column < 2; ++column) measure(row, column, 1000);  // three each
  measure(4, 0, 1000);                                                      // none
  measure(4, 4, 1000).support = 1;
  measure(0, 4, 1000).lit = map.lit_sets.place_of(3);  // two projectors
  EXPECT_EQ(drop_lone_guided_nodes(map), 1U);
  EXPECT_FALSE(map.nodes[map.index(4, 0)].measured());
}

}  // namespace
}  // namespace pencilscan
