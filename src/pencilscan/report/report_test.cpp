#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <numbers>
#include <opencv2/core.hpp>

#include "pencilscan/io/image.h"
#include "pencilscan/report/device_drawing.h"
#include "pencilscan/report/overlay.h"
#include "pencilscan/report/pictures.h"
#include "pencilscan/report/rig_picture.h"
#include "pencilscan/report/shaded_view.h"

namespace pencilscan {
namespace {

double color_distance(const Color& a, const Color& b) {
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

cv::Mat grey_image(int width = 64, int height = 48) {
  return cv::Mat(height, width, CV_32FC3, cv::Scalar(0.2, 0.2, 0.2));
}

TEST(Palette, ColorsOfKeysDiffer) {
  for (int a = -1; a < 8; ++a) {
    for (int b = a + 1; b < 8; ++b) {
      EXPECT_GT(color_distance(categorical_color(a), categorical_color(b)), 60) << a << " " << b;
    }
  }
  EXPECT_EQ(categorical_color(11), categorical_color(3));
}

TEST(Overlay, CurveHasTheColorOfItsKeyAtItsPixels) {
  const std::vector<OverlayCurve> curves = {{{{5, 20}, {55, 20}}, 3}, {{{30, 2}, {30, 45}}, -1}};
  const cv::Mat picture = draw_overlay(grey_image(), curves);
  ASSERT_EQ(picture.type(), CV_8UC3);
  EXPECT_GT(picture.rows, 48);  // the legend below
  EXPECT_EQ(picture.cols, 64);
  // An antialiased line at an integer row keeps nearly its full colour there.
  EXPECT_LT(color_distance(picture.at<Color>(20, 15), categorical_color(3)), 40);
  EXPECT_LT(color_distance(picture.at<Color>(10, 30), kUndecidedColor), 40);
  // The decided curve lies on top of the undecided one.
  EXPECT_LT(color_distance(picture.at<Color>(20, 30), categorical_color(3)), 40);
  const Color ground = picture.at<Color>(40, 5);
  EXPECT_EQ(ground, picture.at<Color>(25, 15));
  EXPECT_LT(ground[0], 100);
}

TEST(Displayable, DarkPicturesAreBrightened) {
  const cv::Mat light = grey_image();
  const auto shown = [](const cv::Mat& image) { return displayable(image).at<Color>(0, 0)[0]; };
  EXPECT_EQ(shown(light), 123);  // 0.2^(1 / 2.2) of 255
  EXPECT_LT(shown(0.5 * light), shown(light));
  EXPECT_EQ(shown(light / 64), 255);
  EXPECT_EQ(shown(0 * light), 0);
}

TEST(Overlay, ZoomKeepsPixelCentres) {
  const std::vector<OverlayCurve> curves = {{{{10, 20}, {40, 20}}, 0}};
  OverlayOptions options;
  options.zoom = 3;
  options.legend = false;
  const cv::Mat picture = draw_overlay(grey_image(), curves, options);
  ASSERT_EQ(picture.size(), cv::Size(192, 144));
  EXPECT_LT(color_distance(picture.at<Color>(61, 60), categorical_color(0)), 40);
  EXPECT_EQ(picture.at<Color>(58, 60), picture.at<Color>(30, 60));
}

TEST(Overlay, PointsAreChainedAlongTheirLine) {
  Rig rig;
  rig.projectors.resize(2);
  rig.projectors[1].patterns.resize(1);
  std::vector<MeasuredPoint> points;
  for (int v = 0; v < 60; ++v) {
    if (v >= 30 && v < 40) continue;  // a gap breaks the curve
    MeasuredPoint p;
    p.u = 20 + 0.3F * static_cast<float>(v);
    p.v = static_cast<float>(v);
    p.camera = 2;
    p.projector = 1;
    p.line = 13;
    points.push_back(p);
  }
  const auto by_id = curves_of_points(rig, points, 2, OverlayKey::kLocalId);
  ASSERT_EQ(by_id.size(), 2u);
  EXPECT_EQ(by_id[0].key, 13 % 8);
  EXPECT_EQ(by_id[0].points.size() + by_id[1].points.size(), points.size());
  EXPECT_EQ(curves_of_points(rig, points, 2, OverlayKey::kProjector)[0].key, 1);
  EXPECT_TRUE(curves_of_points(rig, points, 0, OverlayKey::kProjector).empty());
  const std::vector<char> unused(points.size(), 0);
  EXPECT_EQ(curves_of_points(rig, points, 2, OverlayKey::kLocalId, unused)[0].key, -1);
}

TEST(ShadedView, SilhouetteOfABallHasItsProjectedArea) {
  const double radius = 50;
  const TriangleMesh ball = make_sphere(radius, 64, Vec3(10, 20, 30));
  const Device view = make_view({Vec3(10, 20, 30), 1.3 * radius}, Vec3(1, 2, 0.5), 160, 160);
  const MeshPainter painter(ball, 0);
  const double area = cv::sum(painter.coverage(view))[0];
  // A ball at distance d subtends asin(r / d); on the axis its image is a circle.
  const double d = (view.center() - Vec3(10, 20, 30)).norm();
  const double image_radius = view.K(0, 0) * std::tan(std::asin(radius / d));
  const double expected = std::numbers::pi * image_radius * image_radius;
  EXPECT_NEAR(area / expected, 1, 0.005);  // 64 rings lie 0.1 % inside, 2x2 rays per pixel
}

TEST(ShadedView, BallIsLitFromAboveOnALightGround) {
  const Device view = make_view({Vec3::Zero(), 1.5}, Vec3(1, 0, 0), 120, 120);
  const cv::Mat picture = MeshPainter(make_sphere(1)).draw(view);
  ASSERT_EQ(picture.type(), CV_8UC3);
  const auto brightness = [&](int y, int x) { return cv::sum(picture.at<Color>(y, x))[0]; };
  EXPECT_GT(brightness(35, 50), brightness(90, 70) + 100);
  EXPECT_GT(brightness(3, 3), 700);
  EXPECT_NE(picture.at<Color>(60, 60), picture.at<Color>(3, 3));
}

TEST(ShadedView, VertexColorsAndInventedPartsShow) {
  TriangleMesh ball = make_sphere(1);
  const Device view = make_view({Vec3::Zero(), 1.5}, Vec3(1, 0, 0), 60, 60);
  const Color clay = MeshPainter(ball).draw(view).at<Color>(30, 30);
  EXPECT_GT(clay[0], clay[2]);
  ball.confidence.assign(ball.vertices.size(), 0.0F);
  const Color invented = MeshPainter(ball).draw(view).at<Color>(30, 30);
  EXPECT_GT(invented[2], invented[0]);
  ShadeOptions options;
  options.vertex_colors.assign(ball.vertices.size(), Color{255, 0, 0});
  const Color red = MeshPainter(ball).draw(view, options).at<Color>(30, 30);
  EXPECT_GT(red[0], 100);
  EXPECT_EQ(red[1], 0);
}

TEST(PointView, PointAppearsAtItsPixelInItsColor) {
  const Device view = make_view({Vec3::Zero(), 10}, Vec3(1, 0, 0), 80, 80);
  const std::vector<Vec3> points = {{0, 3, 2}, {-5, 0, 0}, {5, 0, 0}};
  const std::vector<Color> colors = {{255, 0, 0}, {0, 255, 0}, {0, 0, 255}};
  const cv::Mat picture = point_view(points, colors, view, 0.5);
  const Vec2 first = *view.project(points[0]);
  const auto at = [&](const Vec2& p) {
    return picture.at<Color>(static_cast<int>(std::lround(p[1])),
                             static_cast<int>(std::lround(p[0])));
  };
  EXPECT_GT(at(first)[0], 200);
  const Color middle = at(*view.project(points[2]));
  EXPECT_GT(middle[2], 200);  // the nearer point hides the one behind
  EXPECT_LT(middle[1], 60);
}

TEST(Pictures, FrameGivesOnePngPerPicture) {
  Rig rig;
  rig.cameras.resize(1);
  static_cast<Device&>(rig.cameras[0]) = make_view({Vec3::Zero(), 12}, Vec3(1, 1, 0), 64, 48);
  rig.cameras[0].name = "cam0";
  rig.projectors.resize(1);
  static_cast<Device&>(rig.projectors[0]) = make_view({Vec3::Zero(), 12}, Vec3(1, -1, 0), 64, 48);
  rig.projectors[0].name = "proj0";
  rig.projectors[0].patterns.resize(1);
  TriangleMesh ball = make_sphere(10, 12);
  std::vector<MeasuredPoint> points(1);
  points[0].x = 10;
  const std::vector<cv::Mat> images = {grey_image()};
  PictureOptions options;
  options.width = 40;
  options.height = 40;
  const TriangleMesh truth = make_sphere(10.5, 12);
  const auto pictures = make_pictures(
      {.rig = rig, .images = images, .points = points, .mesh = &ball, .truth = &truth}, options);
  const auto folder = std::filesystem::path(testing::TempDir()) / "report_pictures";
  write_pictures(folder, pictures);
  for (const char* name :
       {"cam0_local_id", "cam0_projector", "points", "shape", "scene", "distance"}) {
    const cv::Mat image = read_image(folder / (std::string(name) + ".png"));
    double low = 0;
    double high = 0;
    cv::minMaxLoc(image.reshape(1), &low, &high);
    EXPECT_GT(high - low, 0.2) << name;
  }
  std::filesystem::remove_all(folder);
}

TEST(RigPicture, DevicesAndVolumeStandToScaleInBothViews) {
  Rig rig;
  rig.cameras.emplace_back();
  static_cast<Device&>(rig.cameras[0]) = make_view({Vec3::Zero(), 100}, Vec3(1, 0, 0), 64, 48);
  rig.cameras[0].device_from_world = look_at({1000, 0, 200}, Vec3::Zero());
  rig.cameras[0].name = "cam0";
  rig.projectors.emplace_back();
  static_cast<Device&>(rig.projectors[0]) = rig.cameras[0];
  rig.projectors[0].device_from_world = look_at({-1000, 0, -200}, Vec3::Zero());
  rig.projectors[0].name = "proj0";
  rig.volume = Sphere{Vec3::Zero(), 100};
  constexpr int kSide = 500;
  const cv::Mat picture = draw_rig(rig, kSide);
  ASSERT_EQ(picture.size(), cv::Size(2 * kSide, kSide));
  // 2000 mm fill four fifths of a view.
  const auto at = [&](int view, double x, double up) {
    return picture.at<Color>(static_cast<int>(kSide / 2.0 - 0.2 * up),
                             static_cast<int>(view * kSide + kSide / 2.0 + 0.2 * x));
  };
  EXPECT_LT(color_distance(at(0, 1000, 0), {40, 44, 52}), 20);
  EXPECT_LT(color_distance(at(1, 1000, 200), {40, 44, 52}), 20);
  EXPECT_LT(color_distance(at(0, -1000, 0), light_color(rig.projectors[0])), 20);
  EXPECT_LT(color_distance(at(1, -1000, -200), light_color(rig.projectors[0])), 20);
  EXPECT_GT(color_distance(at(0, 0, 80), at(0, 0, 400)), 15);  // the volume
}

}  // namespace
}  // namespace pencilscan
