#include "pencilscan/simulation/render.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pencilscan/core/parallel.h"
#include "pencilscan/pattern/gray_code.h"
#include "pencilscan/simulation/sensor.h"
#include "pencilscan/simulation/truth.h"

namespace pencilscan {
namespace {

Camera small_camera(const Vec3& eye, int width = 200, int height = 150) {
  Camera camera;
  camera.name = "cam0";
  camera.width = width;
  camera.height = height;
  camera.K << 2.0 * width, 0, 0.5 * width - 3, 0, 2.0 * width, 0.5 * height + 2, 0, 0, 1;
  camera.device_from_world = look_at(eye, Vec3::Zero());
  return camera;
}

Projector small_projector(const Vec3& eye, const std::string& name = "proj0") {
  Projector projector;
  projector.name = name;
  projector.width = 320;
  projector.height = 240;
  projector.K << 640, 0, 160, 0, 640, 118, 0, 0, 1;
  projector.device_from_world = look_at(eye, Vec3::Zero());
  projector.patterns.emplace_back();
  return projector;
}

/// A camera and a projector 30 degrees apart, 1 m from the origin.
Rig pair_rig() {
  Rig rig;
  rig.cameras.push_back(small_camera({1000, 0, 100}));
  rig.projectors.push_back(small_projector({866, 500, 200}));
  rig.volume = Sphere{Vec3::Zero(), 120};
  return rig;
}

PanelLight uniform_light(int size = 320) {
  return {{PanelProfile(Axis::kColumn, {-0.5, size - 0.5}, {Vec3::Ones()})}, 0};
}

Reflectance flat_shading() {
  Reflectance surface;
  surface.smooth = false;
  return surface;
}

/// A 400 mm board through the origin that faces +x.
TriangleMesh board() { return make_box({10, 400, 400}, {-5, 0, 0}); }

TEST(CameraTruth, DepthOfASphereAndABoardMatchesClosedForm) {
  Rig rig = pair_rig();
  rig.cameras[0].distortion = {-0.2, 0.1, 0.002, -0.001, 0};
  const Camera& camera = rig.cameras[0];
  const SimulatedObject flat(board(), flat_shading());
  const CameraTruth truth = camera_truth(rig, 0, flat);
  int seen = 0;
  for (int y = 0; y < camera.height; y += 7) {
    for (int x = 0; x < camera.width; x += 7) {
      const double depth = truth.depth.at<double>(y, x);
      if (std::isnan(depth)) continue;
      const Vec3 point = camera.point_at_depth(Vec2(x, y), depth);
      if (std::abs(point.y()) > 199 || std::abs(point.z()) > 199) continue;
      EXPECT_NEAR(point.x(), 0, 1e-6);  // mm: hits are intersected in double
      ++seen;
    }
  }
  EXPECT_GT(seen, 300);

  constexpr double kRadius = 80;
  constexpr int kRings = 200;
  const SimulatedObject ball(make_sphere(kRadius, kRings));
  const CameraTruth round = camera_truth(rig, 0, ball);
  // Facets of a sphere lie inside it by at most radius * (1 - cos(step)), step = diagonal / 2.
  const double sagitta = kRadius * (1 - std::cos(M_PI / kRings));
  for (int y = 40; y < 110; y += 5) {
    for (int x = 60; x < 130; x += 5) {
      const double depth = round.depth.at<double>(y, x);
      if (std::isnan(depth)) continue;
      const double radius = camera.point_at_depth(Vec2(x, y), depth).norm();
      EXPECT_LE(radius, kRadius + 1e-6);
      EXPECT_GE(radius, kRadius - 2 * sagitta);
    }
  }
}

TEST(CameraTruth, LineCoordinateIsTheProjectionThroughBothLenses) {
  Rig rig = pair_rig();
  rig.cameras[0].distortion = {-0.2, 0.1, 0.002, -0.001, 0};
  rig.projectors[0].distortion = {0.15, -0.05, -0.001, 0.002, 0};
  const SimulatedObject object(board(), flat_shading());
  const CameraTruth truth = camera_truth(rig, 0, object);
  const LinePattern& pattern = rig.projectors[0].patterns[0];
  int checked = 0;
  for (int y = 5; y < 150; y += 9) {
    for (int x = 5; x < 200; x += 9) {
      const double line = truth.projectors[0].line[0].at<double>(y, x);
      if (std::isnan(line)) continue;
      // Independent route: the camera's ray meets the light sheet of that line on the board.
      const RayInProjector ray(rig.cameras[0], rig.projectors[0], Vec2(x, y));
      const auto depth = ray.depth(pattern.position_px(line), Axis::kColumn);
      ASSERT_TRUE(depth);
      EXPECT_NEAR(rig.cameras[0].point_at_depth(Vec2(x, y), *depth).x(), 0, 1e-5);
      ++checked;
    }
  }
  EXPECT_GT(checked, 100);
}

/// Off its axis, the polynomial of a lens may turn back into the panel; its light does not.
TEST(CameraTruth, NoLightBeyondWhereALensTurnsBack) {
  Rig rig;
  rig.cameras.push_back(small_camera({1000, 0, 0}));
  rig.projectors.push_back(small_projector({1000, 0, 0}));
  rig.projectors[0].distortion = {-2, 0, 0, 0, 0};  // turns back at 22 degrees
  const SimulatedObject wall(make_box({10, 4000, 4000}, {-5, 0, 0}), flat_shading());
  EXPECT_GT(cv::countNonZero(camera_truth(rig, 0, wall).projectors[0].lit), 1000);
  rig.cameras[0].device_from_world = look_at({1000, 700, 0}, {0, 700, 0});
  const Projector& projector = rig.projectors[0];
  const Vec3 far_out = projector.device_from_world * Vec3(0, 700, 0);
  ASSERT_TRUE(projector.contains(projector.pixel_from_device(far_out))) << "by the formula";
  EXPECT_FALSE(projector.project({0, 700, 0}));
  EXPECT_EQ(cv::countNonZero(camera_truth(rig, 0, wall).projectors[0].lit), 0);
  const std::vector<PanelLight> lights{uniform_light()};
  EXPECT_EQ(cv::norm(render_camera(rig, 0, wall, lights), cv::NORM_INF), 0);
}

TEST(CameraTruth, ShadowOfABallOnABoardIsWhereTheSegmentMeetsTheBall) {
  Rig rig = pair_rig();
  constexpr double kRadius = 30;
  const Vec3 center(100, 40, 20);
  TriangleMesh scene = board();
  const TriangleMesh ball = make_sphere(kRadius, 120, center);
  const int base = static_cast<int>(scene.vertices.size());
  scene.vertices.insert(scene.vertices.end(), ball.vertices.begin(), ball.vertices.end());
  for (const auto& f : ball.faces) scene.faces.push_back({f[0] + base, f[1] + base, f[2] + base});
  const SimulatedObject object(scene);
  const CameraTruth truth = camera_truth(rig, 0, object);
  const Vec3 light = rig.projectors[0].center();
  int dark = 0;
  for (int y = 0; y < 150; ++y) {
    for (int x = 0; x < 200; ++x) {
      const double depth = truth.depth.at<double>(y, x);
      if (std::isnan(depth)) continue;
      const Vec3 point = rig.cameras[0].point_at_depth(Vec2(x, y), depth);
      if (std::abs(point.x()) > 0.01 || std::isnan(truth.projectors[0].line[0].at<double>(y, x))) {
        continue;
      }
      const Vec3 way = (light - point).normalized();
      const double miss = (center - point).cross(way).norm();
      if (std::abs(miss - kRadius) < 0.1) continue;  // facets of the ball
      EXPECT_EQ(truth.projectors[0].lit.at<std::uint8_t>(y, x), miss > kRadius ? 1 : 0);
      dark += miss < kRadius ? 1 : 0;
    }
  }
  EXPECT_GT(dark, 50);
}

TEST(RenderCamera, UniformLightFollowsTheCosineAndTheInverseSquare) {
  const Rig rig = pair_rig();
  Reflectance surface;
  surface.albedo = 0.7;
  surface.smooth = false;
  const SimulatedObject object(board(), surface);
  const std::vector<PanelLight> lights{uniform_light()};
  const cv::Mat image = render_camera(rig, 0, object, lights);
  const Vec3 source = rig.projectors[0].center();
  const double reference = source.norm();
  for (const Vec3& point : {Vec3(0, 0, 0), Vec3(0, 60, -40), Vec3(0, -50, 30)}) {
    const auto pixel = rig.cameras[0].project(point);
    const Vec3 way = source - point;
    const double expected = 0.55 * 0.7 * way.normalized().x() * std::pow(reference / way.norm(), 2);
    const auto value = image.at<cv::Vec3f>(static_cast<int>(std::lround(pixel->y())),
                                           static_cast<int>(std::lround(pixel->x())));
    EXPECT_NEAR(value[1], expected, 1e-3);  // light varies by that over half a pixel
    EXPECT_EQ(value[0], value[2]);
  }
}

TEST(RenderCamera, LightOfALineIsItsWidthTimesItsColour) {
  const Rig rig = pair_rig();
  const SimulatedObject object(board(), flat_shading());
  const std::vector<PanelLight> white{uniform_light()};
  for (const double blur_px : {0.0, 1.5}) {
    FilmOptions film;
    film.blur_px = blur_px;
    const std::vector<PanelLight> lines = line_lights(rig, film);
    const cv::Mat bright = render_camera(rig, 0, object, white);
    const cv::Mat image = render_camera(rig, 0, object, lines);
    // Whole rows hold many periods: blue is lit for 4 of 12 panel px in every line, green in half.
    const cv::Rect inside(20, 60, 160, 30);
    const cv::Scalar light = cv::mean(image(inside));
    const cv::Scalar share = light * (1 / cv::mean(bright(inside))[2]);
    constexpr double kPartialLines = 0.03;  // lines cut by the window's sides
    EXPECT_NEAR(share[2], 4.0 / 12, kPartialLines);
    EXPECT_NEAR(share[1], 2.0 / 12, kPartialLines);
    EXPECT_EQ(share[0], 0);
  }
}

TEST(RenderCamera, LineCentresLieWhereTheProjectorSaysOnAPlane) {
  Rig rig = pair_rig();
  rig.cameras[0] = small_camera({1000, 0, 100}, 640, 200);
  rig.cameras[0].distortion = {-0.2, 0.1, 0.002, -0.001, 0};
  rig.projectors[0].distortion = {0.15, -0.05, -0.001, 0.002, 0};
  const SimulatedObject object(board(), flat_shading());
  const cv::Mat image = render_camera(rig, 0, object, line_lights(rig));
  const CameraTruth truth = camera_truth(rig, 0, object);
  const cv::Mat& line = truth.projectors[0].line[0];
  double sum = 0;
  int count = 0;
  for (const int y : {60, 100, 140}) {
    for (int k = 4; k < 22; ++k) {
      // Centroid of the light in line coordinate, over the line's own half period.
      double weight = 0;
      double moment = 0;
      for (int x = 0; x < 640; ++x) {
        const double offset = line.at<double>(y, x) - k;
        if (!(std::abs(offset) < 0.5)) continue;
        const double value = image.at<cv::Vec3f>(y, x)[2];
        weight += value;
        moment += value * offset;
      }
      if (weight < 0.5) continue;
      sum += std::pow(12 * moment / weight, 2);  // projector px
      ++count;
    }
  }
  ASSERT_GT(count, 30);
  EXPECT_LT(std::sqrt(sum / count), 0.02);  // projector px; pixels sample 12 px in about 24 steps
}

TEST(RenderCamera, ProjectorsAddUpWithTheirColourMatrices) {
  Rig rig = pair_rig();
  rig.projectors.push_back(small_projector({866, -500, 200}, "proj1"));
  Mat3 red_only = Mat3::Zero();
  red_only(0, 2) = 0.5;  // half of the blue light is seen as red
  rig.cameras[0].color_matrix_by_projector["proj1"] = red_only;
  const SimulatedObject object(board(), flat_shading());
  const std::vector<PanelLight> both{uniform_light(), uniform_light()};
  const std::vector<PanelLight> first{uniform_light(), {}};
  const cv::Mat a = render_camera(rig, 0, object, both);
  const cv::Mat b = render_camera(rig, 0, object, first);
  const auto va = a.at<cv::Vec3f>(75, 100);
  const auto vb = b.at<cv::Vec3f>(75, 100);
  EXPECT_EQ(va[1], vb[1]);
  EXPECT_NEAR(va[0], 1.5 * vb[0], 0.02 * vb[0]);  // the projectors are mirror images of each other
}

TEST(RenderCamera, SameBytesForAnyThreadCount) {
  const Rig rig = pair_rig();
  Reflectance surface;
  surface.texture.kind = TextureKind::kNoise;
  const SimulatedObject object(make_sphere(90, 24), surface);
  const SensorOptions sensor = sensor_preset("medium")->sensor;
  std::vector<cv::Mat> images;
  for (const int threads : {1, 2, 4}) {
    const ThreadLimit limit(threads);
    images.push_back(apply_sensor(render_camera(rig, 0, object, line_lights(rig)), sensor, 7, 3));
  }
  EXPECT_EQ(cv::norm(images[0], images[1], cv::NORM_INF), 0);
  EXPECT_EQ(cv::norm(images[0], images[2], cv::NORM_INF), 0);
  EXPECT_GT(cv::norm(images[0], cv::NORM_INF), 0);
}

TEST(RenderSequence, GrayCodesDecodeToTheProjectedPixel) {
  Rig rig = pair_rig();
  const Projector& projector = rig.projectors[0];
  const SimulatedObject object(board(), flat_shading());
  const auto sequence = gray_code_sequence(projector.width, projector.height);
  std::vector<PanelLight> lights;
  for (const auto& image : sequence) lights.push_back(gray_code_light(projector, image));
  const auto images = render_sequence(rig, 0, 0, object, lights);
  ASSERT_EQ(images.size(), sequence.size());
  const CameraTruth truth = camera_truth(rig, 0, object);
  int decoded = 0;
  for (int y = 3; y < 150; y += 5) {
    for (int x = 3; x < 200; x += 5) {
      if (truth.projectors[0].lit.at<std::uint8_t>(y, x) == 0) continue;
      std::vector<std::uint8_t> bright(sequence.size(), 0);
      bool clear = true;
      for (std::size_t i = 2; i + 1 < sequence.size(); i += 2) {
        const float on = images[i].at<float>(y, x);
        const float off = images[i + 1].at<float>(y, x);
        bright[i] = on > off ? 1 : 0;
        clear = clear && std::abs(on - off) > 0.02F * (on + off);
      }
      if (!clear) continue;  // a stripe's edge runs through the pixel's centre
      const GrayCodeIndex index = decode_gray_code(sequence, bright);
      const auto pixel = projector.project(
          rig.cameras[0].point_at_depth(Vec2(x, y), truth.depth.at<double>(y, x)));
      // A camera pixel covers less than two panel pixels; the majority inside it wins.
      EXPECT_NEAR(index.column, pixel->x(), 1.0);
      EXPECT_NEAR(index.row, pixel->y(), 1.0);
      ++decoded;
    }
  }
  EXPECT_GT(decoded, 300);
}

TEST(RenderCamera, ALensMovesTheLightOfOneColour) {
  Rig rig = pair_rig();
  const SimulatedObject object(board(), flat_shading());
  const cv::Mat plain = render_camera(rig, 0, object, line_lights(rig));
  rig.cameras[0].color_registration.colors[2].shift_px = Vec2(2, -1);
  const cv::Mat moved = render_camera(rig, 0, object, line_lights(rig));
  const cv::Rect inside(30, 30, 140, 90);
  std::vector<cv::Mat> before, after;
  cv::split(plain(inside), before);
  cv::split(moved(inside + cv::Point(2, -1)), after);
  EXPECT_LT(cv::norm(before[2], after[2], cv::NORM_INF), 1e-5);  // whole pixels: the same rays
  cv::split(moved(inside), after);
  EXPECT_LT(cv::norm(before[1], after[1], cv::NORM_INF), 1e-5);
  EXPECT_GT(cv::norm(before[2], after[2], cv::NORM_INF), 0.1);
}

TEST(RenderCamera, APanelMovesTheLinesOfOneColour) {
  Rig rig = pair_rig();
  rig.projectors[0].patterns[0].colors = {"blue"};
  rig.projectors[0].patterns[0].alphabet = 1;
  rig.projectors[0].patterns[0].sequence = {0};
  Rig shifted = rig;
  const SimulatedObject object(board(), flat_shading());
  rig.projectors[0].color_registration.colors[2].shift_px = Vec2(1.5, 0);
  // Blue of panel column q lies where the model has q - 1.5.
  shifted.projectors[0].patterns[0].offset_px -= 1.5;
  const cv::Mat a = render_camera(rig, 0, object, line_lights(rig));
  const cv::Mat b = render_camera(shifted, 0, object, line_lights(shifted));
  EXPECT_LT(cv::norm(a(cv::Rect(20, 20, 160, 110)), b(cv::Rect(20, 20, 160, 110)), cv::NORM_INF),
            1e-5);
}

TEST(RenderSequence, InColourIsWhatTheCameraSeesOfEachColour) {
  Rig rig = pair_rig();
  Mat3 leaky;
  leaky << 0.9, 0.1, 0, 0.05, 0.9, 0.05, 0, 0.1, 0.9;
  rig.cameras[0].color_matrix = leaky;
  const SimulatedObject object(board(), flat_shading());
  const std::vector<PanelLight> lights{line_light(rig.projectors[0]),
                                       solid_light(rig.projectors[0], {"red", {1, 0, 0}})};
  const auto color = render_color_sequence(rig, 0, 0, object, lights);
  const auto grey = render_sequence(rig, 0, 0, object, std::vector{uniform_light()});
  ASSERT_EQ(color.size(), 2U);
  const cv::Mat frame = render_camera(rig, 0, object, line_lights(rig));
  EXPECT_LT(cv::norm(color[0], frame, cv::NORM_INF), 1e-5);
  for (const cv::Point at : {cv::Point(80, 70), cv::Point(120, 90)}) {
    const auto red = color[1].at<cv::Vec3f>(at);
    const float light = grey[0].at<float>(at);
    EXPECT_NEAR(red[0], 0.9 * light, 1e-4);
    EXPECT_NEAR(red[1], 0.05 * light, 1e-4);
    EXPECT_NEAR(red[2], 0, 1e-6);
  }
}

TEST(RenderSequence, IsEmptyWhereTheCameraSeesNoLitPoint) {
  Rig rig = pair_rig();
  rig.projectors[0] = small_projector({-1000, 0, 0});  // behind the board
  const SimulatedObject object(board(), flat_shading());
  const std::vector<PanelLight> lights{uniform_light()};
  EXPECT_TRUE(render_sequence(rig, 0, 0, object, lights).empty());
}

TEST(SurfaceTexture, FactorStaysWithinItsContrast) {
  for (const TextureKind kind :
       {TextureKind::kNoise, TextureKind::kStripes, TextureKind::kChecker}) {
    const SurfaceTexture texture{kind, 0.6, 15};
    double low = 1;
    double high = 0;
    for (int i = 0; i < 5000; ++i) {
      const double f = texture.factor(Vec3(0.37 * i, -0.71 * i, 0.11 * i));
      low = std::min(low, f);
      high = std::max(high, f);
    }
    EXPECT_GE(low, 0.4 - 1e-12);
    EXPECT_LE(high, 1 + 1e-12);
    EXPECT_GT(high - low, 0.3);
  }
}

}  // namespace
}  // namespace pencilscan
