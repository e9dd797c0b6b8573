#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <span>
#include <vector>

#include "pencilscan/core/random.h"
#include "pencilscan/detection/detect.h"
#include "pencilscan/detection/ghosts.h"
#include "pencilscan/detection/mosaic_trace.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/view/sample_color.h"

namespace pencilscan {
namespace {

/// A straight bright line: centre line through `point` along (cos, sin), a box `width` wide with
/// blurred edges, from -inf to where x reaches `end_x`.
struct TestLine {
  double x = 0, y = 0;
  double angle = 0;  ///< of the direction
  double width = 4;
  double end_x = 1e9;
  cv::Vec3f color = {0, 0, 1};

  [[nodiscard]] double distance(double px, double py) const {
    return -(px - x) * std::sin(angle) + (py - y) * std::cos(angle);
  }
};

/// Image of lines over a small background, `noise` standard deviation; box edges blurred, px.
cv::Mat draw(const std::vector<TestLine>& lines, int width, int height, double noise,
             double blur = 0.7) {
  cv::Mat image(height, width, CV_32FC3);
  const auto step = [&](double d) { return 0.5 * (1 + std::erf(d / (blur * std::sqrt(2.0)))); };
  for (int y = 0; y < height; ++y) {
    Random random(11, static_cast<std::uint64_t>(y));
    for (int x = 0; x < width; ++x) {
      cv::Vec3f value(0.01F, 0.01F, 0.01F);
      for (const TestLine& line : lines) {
        const double d = line.distance(x, y);
        const double level =
            step(d + line.width / 2) * step(line.width / 2 - d) * step(line.end_x - x);
        value += line.color * static_cast<float>(0.5 * level);
      }
      for (int c = 0; c < 3; ++c) value[c] += static_cast<float>(random.normal(0, noise));
      image.at<cv::Vec3f>(y, x) = value;
    }
  }
  return image;
}

/// One camera and one projector with blue/cyan vertical lines, another with red/yellow ones.
Rig two_color_rig(int width, int height) {
  Rig rig;
  Camera camera;
  camera.name = "cam";
  camera.width = width;
  camera.height = height;
  camera.color_matrix = Mat3::Identity();
  rig.cameras = {camera};
  for (int p = 0; p < 2; ++p) {
    Projector projector;
    projector.width = projector.height = 100;
    projector.patterns = {LinePattern()};
    if (p == 1) projector.patterns[0].colors = {"red", "yellow"};
    rig.projectors.push_back(projector);
  }
  return rig;
}

CameraDetection detect(const cv::Mat& image) {
  const Rig rig = two_color_rig(image.cols, image.rows);
  return detect_curves(rig.cameras[0], rig, color_families(rig), image);
}

TEST(ColorFamily, PresenceSeparatesThePapersColourPairs) {
  const auto families = color_families(two_color_rig(10, 10));
  ASSERT_EQ(families.size(), 2U);
  EXPECT_NEAR((families[0].presence - Vec3(0, 0, 1)).norm(), 0, 1e-12);  // blue and cyan
  EXPECT_NEAR((families[1].presence - Vec3(1, 0, 0)).norm(), 0, 1e-12);  // red and yellow
  EXPECT_LT(families[0].leakage, 1e-12);
}

TEST(ColorFamily, ColoursThatACameraTakesForEachOtherAreOfOneFamily) {
  const auto families_with = [](const std::vector<PatternColor>& colors) {
    Rig rig = two_color_rig(10, 10);
    Projector third = rig.projectors[0];
    third.name = "third";
    third.patterns[0].colors = colors;
    rig.projectors.push_back(third);
    return color_families(rig);
  };
  using Light = Rgb;
  const std::vector<std::vector<PatternColor>> alike = {
      {PatternColor(Light{0, 0, 0.4}), PatternColor(Light{0, 0.4, 0.4})},        // darker
      {PatternColor(Light{0, 0, 1}), PatternColor(Light{0, 0.98, 1})},           // a driver's
      {PatternColor(Light{0, 0.9, 0.9}), PatternColor(Light{0.03, 0.05, 0.9})},  // in any order
  };
  for (const auto& colors : alike) {
    const auto families = families_with(colors);
    ASSERT_EQ(families.size(), 2U);
    EXPECT_EQ(families[0].patterns.size(), 2U);
    EXPECT_FALSE(families[0].mixes());
  }
  // Each colour of a pattern is one of the family's, whatever their order.
  LinePattern pattern;
  pattern.colors = alike.back();
  const std::vector<int> colors = families_with(alike.back())[0].color_of_symbol(pattern);
  EXPECT_EQ(colors, (std::vector<int>{1, 0}));
  // Half of the colours in common is no family, but a mixture.
  const auto half = families_with({"blue", "green"});
  ASSERT_EQ(half.size(), 3U);
  EXPECT_TRUE(half[0].mixes());
}

TEST(DetectCurves, SubPixelErrorIsSmallAndAsLargeAsSigmaSays) {
  std::vector<TestLine> lines;
  for (int i = 0; i < 8; ++i) lines.push_back({20.0 + 14.3 * i, 0, 1.45, 4, 1e9, {0, 0, 1}});
  const CameraDetection found = detect(draw(lines, 160, 120, 0.01));
  std::vector<double> errors;
  std::size_t within = 0;
  for (const Curve& curve : found.curves) {
    for (const CurvePoint& p : curve.points) {
      // At the image border profiles and averages are cut off.
      if (p.position.y() < 8 || p.position.y() > 112) continue;
      double best = 1e9;
      for (const TestLine& line : lines) {
        const double d = line.distance(p.position.x(), p.position.y());
        if (std::abs(d) < std::abs(best)) best = d;
      }
      errors.push_back(std::abs(best));
      within += std::abs(best) < p.sigma_px;
    }
  }
  ASSERT_GT(errors.size(), 8 * 90U);  // nearly all of the 104 rows of each line
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.03);
  EXPECT_LT(errors[errors.size() * 95 / 100], 0.10);
  const double share = static_cast<double>(within) / static_cast<double>(errors.size());
  EXPECT_GT(share, 0.45);  // ideal 0.68; neighbouring points share pixels, so the sample is small
  EXPECT_LT(share, 0.95);
}

/// A quarter of the samples, each counted once. Fitted to the values between them, the errors of
/// these curves were 1.5 times as large as stated.
TEST(DetectCurves, SigmaBehindAMosaicIsThatOfItsSamples) {
  std::vector<TestLine> lines;
  for (int i = 0; i < 15; ++i)
    lines.push_back({30.0 + 16 * i, 0, 1.5708 - 0.25, 3, 1e9, {0, 0, 1}});
  const cv::Mat image = draw(lines, 260, 220, 0.03);
  Rig rig = two_color_rig(image.cols, image.rows);
  rig.cameras[0].mosaic = Mosaic::from_name("RGGB");
  const CameraDetection found = detect_curves(rig.cameras[0], rig, color_families(rig),
                                              sampled(image, *rig.cameras[0].mosaic));
  double square = 0;
  double stated = 0;
  for (const Curve& curve : found.curves) {
    for (const CurvePoint& p : curve.points) {
      double nearest = 1e9;
      for (const TestLine& line : lines) {
        const double d = line.distance(p.position.x(), p.position.y());
        if (std::abs(d) < std::abs(nearest)) nearest = d;
      }
      if (std::abs(nearest) > 1) continue;
      square += nearest * nearest;
      stated += p.sigma_px * p.sigma_px;
    }
  }
  EXPECT_GT(std::sqrt(square / stated), 0.75);
  EXPECT_LT(std::sqrt(square / stated), 1.25);
}

TEST(DetectCurves, EndsWhereTheLineEnds) {
  const std::vector<TestLine> lines = {{0, 60, 0, 4, 100.0, {0, 0, 1}},
                                       {0, 30, 0, 4, 70.5, {0, 0, 1}}};
  const CameraDetection found = detect(draw(lines, 160, 90, 0.005));
  ASSERT_EQ(found.curves.size(), 2U);
  for (const Curve& curve : found.curves) {
    float last = 0;
    for (const CurvePoint& p : curve.points) last = std::max(last, p.position.x());
    const double end = curve.points.front().position.y() > 45 ? 100.0 : 70.5;
    EXPECT_NEAR(last, end, 1.5);  // no overshoot of the elongated filter, which reaches 7 px
  }
}

TEST(DetectCurves, BothLinesSurviveACrossingOfOneColour) {
  const std::vector<TestLine> lines = {{0, 60, 0.3, 4, 1e9, {0, 0, 1}},
                                       {0, 100, -0.3, 4, 1e9, {0, 0, 1}}};
  const CameraDetection found = detect(draw(lines, 160, 160, 0.005));
  for (const TestLine& line : lines) {
    std::size_t on_line = 0;
    for (const Curve& curve : found.curves) {
      for (const CurvePoint& p : curve.points)
        on_line += std::abs(line.distance(p.position.x(), p.position.y())) < 0.3;
    }
    EXPECT_GT(on_line, 130U);
  }
}

TEST(DetectCurves, WideLineIsOneCurveInItsMiddle) {
  const std::vector<TestLine> lines = {{80, 0, 1.5, 8, 1e9, {0, 0, 1}}};
  const CameraDetection found = detect(draw(lines, 160, 100, 0.005));
  ASSERT_EQ(found.curves.size(), 1U);
  EXPECT_GT(found.curves[0].points.size(), 90U);  // of 100 rows
  for (const CurvePoint& p : found.curves[0].points)
    EXPECT_NEAR(lines[0].distance(p.position.x(), p.position.y()), 0, 0.3);
}

TEST(DetectCurves, EveryLineOfADenseFieldIsFoundHoweverSharpItIs) {
  for (const double blur : {0.3, 0.7}) {
    std::vector<TestLine> lines;
    for (int i = 0; i < 12; ++i) lines.push_back({20.0 + 4.2 * i, 0, 1.45, 1.4});
    const CameraDetection found = detect(draw(lines, 320, 120, 0.005, blur));
    for (const TestLine& line : lines) {
      std::size_t of_line = 0;
      for (const Curve& curve : found.curves)
        for (const CurvePoint& p : curve.points)
          of_line += std::abs(line.distance(p.position.x(), p.position.y())) < 0.4;
      EXPECT_GT(of_line, 110U) << "of 120 rows of the line at " << line.x << ", blur " << blur;
    }
  }
}

/// Presence of ten lines 8 px apart on a bright surface with a dark strip of `dark` times its
/// albedo, from x = 100 to 200, and of the black around.
cv::Mat lines_over_a_dark_strip(float dark, double noise) {
  cv::Mat presence(300, 300, CV_32F);
  for (int y = 0; y < presence.rows; ++y) {
    Random random(12, static_cast<std::uint64_t>(y));
    for (int x = 0; x < presence.cols; ++x) {
      const double d = std::remainder(y - 4.3 - 0.05 * x, 8);
      const auto light = static_cast<float>(y < 80 ? 0.5 * std::exp(-0.5 * d * d) : 0);
      presence.at<float>(y, x) =
          (x < 100 || x >= 200 ? 1 : dark) * light + static_cast<float>(random.normal(0, noise));
    }
  }
  return presence;
}

/// Ridgels in the middle of the strip.
std::size_t ridgels_on_the_strip(const cv::Mat& presence) {
  const std::vector<Ridgel> ridgels = find_ridgels(presence);
  return static_cast<std::size_t>(std::count_if(
      ridgels.begin(), ridgels.end(), [](auto& r) { return r.x > 130 && r.x < 170 && r.y < 80; }));
}

TEST(Ridgels, OfLinesOnADarkSurfaceAreFoundBesideABrightOne) {
  constexpr double kNoise = 0.001;
  constexpr std::size_t kAll = 10 * 40;  // of ten lines
  EXPECT_GT(ridgels_on_the_strip(lines_over_a_dark_strip(0.03F, kNoise)), kAll * 8 / 10);
  // Of noise, and of what 8 bits round, no line is made.
  EXPECT_LT(ridgels_on_the_strip(lines_over_a_dark_strip(0, kNoise)), 3U);
  cv::Mat rounded;
  lines_over_a_dark_strip(0.003F, 0).convertTo(rounded, CV_8U, 255);
  rounded.convertTo(rounded, CV_32F, 1.0 / 255);
  EXPECT_EQ(ridgels_on_the_strip(rounded), 0U);
}

TEST(LooksInterpolated, TellsFilledInColoursFromThreeChannels) {
  Random random(3);
  cv::Mat rgb(240, 320, CV_32FC3);
  for (int y = 0; y < rgb.rows; ++y) {
    for (int x = 0; x < rgb.cols; ++x) {
      const float light = x % 12 < 4 ? 0.5F : 0.02F;
      for (int k = 0; k < 3; ++k)
        rgb.at<cv::Vec3f>(y, x)[k] = light + static_cast<float>(random.normal(0, 0.01));
    }
  }
  EXPECT_FALSE(looks_interpolated(rgb));
  const Mosaic mosaic = *Mosaic::from_name("GRBG");
  EXPECT_TRUE(looks_interpolated(demosaiced(sampled(rgb, mosaic), mosaic)));
}

TEST(LooksInterpolated, LinesAnEvenNumberOfPixelsApartAreNoMosaic) {
  Random random(3);
  for (const cv::Point step : {cv::Point(1, 0), cv::Point(0, 1), cv::Point(1, 1)}) {
    cv::Mat rgb(240, 320, CV_32FC3);
    for (int y = 0; y < rgb.rows; ++y) {
      for (int x = 0; x < rgb.cols; ++x) {
        const int from_line = std::abs((step.x * x + step.y * y) % 8 - 3);
        const float light = from_line == 0 ? 0.5F : from_line == 1 ? 0.1F : 0.02F;
        for (int k = 0; k < 3; ++k)
          rgb.at<cv::Vec3f>(y, x)[k] = light + static_cast<float>(random.normal(0, 0.01));
      }
    }
    EXPECT_FALSE(looks_interpolated(rgb)) << step;
    const Mosaic mosaic = *Mosaic::from_name("RGGB");
    EXPECT_TRUE(looks_interpolated(demosaiced(sampled(rgb, mosaic), mosaic))) << step;
  }
}

/// Lines of two colours in the noise of three full channels.
cv::Mat noisy_lines() {
  return cv::max(draw({{.x = 60, .y = 0, .angle = 1.2, .width = 5, .color = {0.1F, 0.8F, 1}},
                       {.x = 310, .y = 0, .angle = 1.9, .width = 6, .color = {1, 0.2F, 0.1F}},
                       {.x = 0, .y = 170, .angle = 0.3, .width = 4, .color = {0.2F, 1, 0.2F}}},
                      480, 360, 0.02),
                 0);
}

/// The colours of a raw picture filled in by the gradient-corrected filters as Malvar, He and
/// Cutler print them, in eighths.
cv::Mat gradient_corrected(const cv::Mat& raw, const Mosaic& mosaic) {
  const cv::Mat green = (cv::Mat_<float>(5, 5) << 0, 0, -1, 0, 0, 0, 0, 2, 0, 0, -1, 2, 4, 2, -1, 0,
                         0, 2, 0, 0, 0, 0, -1, 0, 0);
  const cv::Mat beside = (cv::Mat_<float>(5, 5) << 0, 0, 0.5, 0, 0, 0, -1, 0, -1, 0, -1, 4, 5, 4,
                          -1, 0, -1, 0, -1, 0, 0, 0, 0.5, 0, 0);
  const cv::Mat opposite = (cv::Mat_<float>(5, 5) << 0, 0, -1.5, 0, 0, 0, 2, 0, 2, 0, -1.5, 0, 6, 0,
                            -1.5, 0, 2, 0, 2, 0, 0, 0, -1.5, 0, 0);
  cv::Mat of_green, of_beside, of_below, of_opposite;
  cv::filter2D(raw, of_green, CV_32F, green / 8);
  cv::filter2D(raw, of_beside, CV_32F, beside / 8);
  cv::filter2D(raw, of_below, CV_32F, beside.t() / 8);
  cv::filter2D(raw, of_opposite, CV_32F, opposite / 8);
  cv::Mat rgb(raw.size(), CV_32FC3);
  for (int y = 0; y < raw.rows; ++y) {
    for (int x = 0; x < raw.cols; ++x) {
      for (int color = 0; color < 3; ++color) {
        const bool is_beside = mosaic.color(x + 1, y) == color;
        const bool is_below = mosaic.color(x, y + 1) == color;
        const cv::Mat& filled = mosaic.color(x, y) == color ? raw
                                : is_beside && is_below     ? of_green
                                : is_beside                 ? of_beside
                                : is_below                  ? of_below
                                                            : of_opposite;
        rgb.at<cv::Vec3f>(y, x)[color] = std::clamp(filled.at<float>(y, x), 0.F, 1.F);
      }
    }
  }
  return rgb;
}

TEST(LooksInterpolated, TellsColoursThatWereFilledInBeforeJpeg) {
  const Mosaic mosaic = *Mosaic::from_name("RGGB");
  const TemporaryFolder temporary("looks_interpolated_jpeg");
  const auto as_jpeg = [&](const cv::Mat& light) {
    cv::Mat values;
    cv::pow(cv::max(light, 0.0), 1 / 2.2, values);
    values.convertTo(values, CV_8U, 255);
    write_jpeg(temporary.path() / "picture.jpg", values, 92);
    return read_image(temporary.path() / "picture.jpg");
  };
  const cv::Mat lines = noisy_lines();
  EXPECT_FALSE(looks_interpolated(as_jpeg(lines)));
  EXPECT_TRUE(looks_interpolated(as_jpeg(gradient_corrected(sampled(lines, mosaic), mosaic))));
  EXPECT_TRUE(looks_interpolated(as_jpeg(demosaiced(sampled(lines, mosaic), mosaic))));
}

/// As a camera with a black level and a gamma stores light.
cv::Mat stored_picture(const cv::Mat& light, const Camera& camera, int depth) {
  cv::Mat values;
  cv::pow(cv::max(light, 0.0), 1 / camera.gamma, values);
  values = values * (1 - camera.black_level) + cv::Scalar::all(camera.black_level);
  cv::Mat stored;
  values.convertTo(stored, depth, depth == CV_8U ? 255 : 65535);
  return stored;
}

TEST(MosaicBehind, IsFoundWhereItsSamplesStandInThePicture) {
  const cv::Mat rgb = noisy_lines();
  for (const char* name : {"RGGB", "BGGR", "GRBG", "GBRG"}) {
    const Mosaic mosaic = *Mosaic::from_name(name);
    const cv::Mat raw = sampled(rgb, mosaic);
    for (const double gamma : {1.0, 2.2}) {
      Camera camera;
      camera.gamma = gamma;
      camera.black_level = 0.05;
      for (const int depth : {CV_8U, CV_16U}) {
        for (const cv::Mat& filled : {demosaiced(raw, mosaic), gradient_corrected(raw, mosaic)}) {
          const cv::Mat stored = stored_picture(filled, camera, depth);
          EXPECT_EQ(mosaic_behind(camera, stored), mosaic) << name << " " << gamma;
          // A picture that was changed afterwards does not hold the samples.
          cv::Mat blurred;
          cv::GaussianBlur(stored, blurred, {}, 0.5);
          EXPECT_EQ(mosaic_behind(camera, blurred), std::nullopt) << name << " " << gamma;
        }
      }
      EXPECT_EQ(mosaic_behind(camera, stored_picture(rgb, camera, CV_8U)), std::nullopt) << gamma;
    }
  }
}

TEST(MosaicBehind, SmoothPicturesOfThreeChannelsHaveNone) {
  const Camera camera;
  for (const double blur : {0.5, 1.0, 2.0, 4.0}) {
    const cv::Mat rgb =
        draw({{.x = 60, .y = 0, .angle = 1.2, .width = 12, .color = {1, 0.8F, 1}},
              {.x = 0, .y = 70, .angle = 0.3, .width = 8, .color = {0.9F, 1, 0.2F}}},
             160, 120, 0, blur);
    EXPECT_EQ(mosaic_behind(camera, stored_picture(rgb, camera, CV_8U)), std::nullopt) << blur;
  }
}

TEST(SampleColor, OfAStoredImageIsThatOfItsValues) {
  for (const int type : {CV_8UC3, CV_16UC3, CV_8UC1, CV_16UC1}) {
    cv::Mat stored(20, 30, type);
    cv::RNG random(3);
    random.fill(stored, cv::RNG::UNIFORM, 0, stored.depth() == CV_8U ? 250 : 64000);
    const cv::Mat values = unit_image(stored);
    for (const double x : {0.0, 3.25, 28.9}) {
      for (const double y : {0.0, 7.5, 18.3})
        EXPECT_TRUE((sample_color(stored, x, y) == sample_color(values, x, y)).all());
    }
    EXPECT_FALSE(sample_color(stored, 29.1, 5).isFinite().any());
    EXPECT_FALSE(sample_color(stored, 3.5, 3.5, 0.001F).isFinite().any());
  }
}

TEST(DetectCurves, CodeTellsBlueFromCyanUnderCrossingLines) {
  std::vector<TestLine> lines;
  const int bits[] = {0, 0, 0, 1, 0, 1, 1, 1};
  for (int i = 0; i < 8; ++i) {
    lines.push_back({16.0 + 16 * i, 0, 1.5708, 4, 1e9, {0, bits[i] != 0 ? 1.F : 0.F, 1}});
    lines.push_back({0, 10.0 + 14 * i, 0.05, 4, 1e9, {1, bits[7 - i] != 0 ? 1.F : 0.F, 0}});
  }
  const CameraDetection found = detect(draw(lines, 150, 125, 0.01));
  const Rig rig = two_color_rig(150, 125);
  const auto families = color_families(rig);
  std::size_t right = 0;
  std::size_t all = 0;
  for (const Curve& curve : found.curves) {
    if (curve.family != 0) continue;
    for (std::size_t i = 0; i < curve.points.size(); ++i) {
      const auto line = static_cast<int>(std::lround((curve.points[i].position.x() - 16) / 16));
      const std::size_t cyan = families[0].colors[0] == "cyan" ? 0 : 1;
      const bool says_cyan = curve.code[2 * i + cyan] > curve.code[2 * i + 1 - cyan];
      ++all;
      right += line >= 0 && line < 8 && says_cyan == (bits[line] != 0);
    }
  }
  ASSERT_GT(all, 700U);
  EXPECT_GT(static_cast<double>(right), 0.97 * static_cast<double>(all));
}

TEST(DetectCurves, ShadesAreToldApartThoughTheCameraSeesOneChannelBrighter) {
  const std::vector<PatternColor> shades = {"blue", PatternColor(Rgb{0, 0.5, 1}), "cyan"};
  const int shade_of[] = {0, 1, 2, 1, 1, 2, 0, 1};  // the middle one most often
  for (const float green : {0.75F, 1.0F, 1.15F, 1.3F}) {
    Rig rig = two_color_rig(150, 125);
    rig.projectors.pop_back();
    rig.projectors[0].patterns[0].colors = shades;
    std::vector<TestLine> lines;
    for (int i = 0; i < 8; ++i) {
      const float level = green * 0.5F * static_cast<float>(shade_of[i]);
      lines.push_back({16.0 + 16 * i, 0, 1.5708, 4, 1e9, {0, level, 1}});
    }
    const CameraDetection found =
        detect_curves(rig.cameras[0], rig, color_families(rig), draw(lines, 150, 125, 0.01));
    std::size_t right = 0;
    std::size_t all = 0;
    for (const Curve& curve : found.curves) {
      for (std::size_t i = 0; i < curve.points.size(); ++i) {
        const auto line = static_cast<int>(std::lround((curve.points[i].position.x() - 16) / 16));
        const auto code = std::span(curve.code).subspan(3 * i, 3);
        const auto best = std::max_element(code.begin(), code.end()) - code.begin();
        const auto& families = color_families(rig);
        const PatternColor& said = families[0].colors[static_cast<std::size_t>(best)];
        ++all;
        right += line >= 0 && line < 8 && said == shades[static_cast<std::size_t>(shade_of[line])];
      }
    }
    ASSERT_GT(all, 700U);
    EXPECT_GT(static_cast<double>(right), 0.97 * static_cast<double>(all)) << green;
  }
}

TEST(EstimateUnmixing, FindsTheCrosstalkThatTheRigDoesNotState) {
  std::vector<TestLine> lines;
  for (int i = 0; i < 24; ++i) {
    lines.push_back({12.0 + 16 * i, 0, 1.5708, 4, 1e9, {0, i % 2 != 0 ? 1.F : 0.F, 1}});
    lines.push_back({0, 10.0 + 16 * i, 0, 4, 1e9, {1, i % 2 != 0 ? 1.F : 0.F, 0}});
  }
  const cv::Mat pure = draw(lines, 400, 400, 0.002);
  Rig rig = two_color_rig(400, 400);
  rig.cameras[0].color_matrix.reset();
  for (const float c : {0.F, 0.08F, 0.25F}) {
    const cv::Matx33f mixing(1 - c, 0.75F * c, 0.25F * c, 0.5F * c, 1 - c, 0.5F * c, 0.25F * c,
                             0.75F * c, 1 - c);
    cv::Mat image;
    cv::transform(pure, image, mixing);
    const Unmixing unmixing = estimate_unmixing(rig.cameras[0], rig, color_families(rig), image);
    EXPECT_TRUE(unmixing.estimated);
    const Mat3 mixed = unmixing.projector_from_camera.inverse();
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column)
        EXPECT_NEAR(mixed(row, column), mixing(row, column) / (1 - c), 0.04)
            << row << ", " << column;
    }
  }
}

TEST(Registered, BringsEachColourToWhereTheModelHasIt) {
  Camera camera;
  camera.width = 200;
  camera.height = 150;
  camera.color_registration.colors[0] = {Vec2(0.45, -0.3), 1.001};
  camera.color_registration.colors[2] = {Vec2(-0.7, 0.5), 1};
  const auto value = [](const Vec2& p) {  // a line's profile: as narrow as they come
    const double across = std::remainder(p.x() + 0.4 * p.y(), 9.0);
    return std::exp(-across * across / (2 * 1.2 * 1.2));
  };
  const auto draw = [&](const cv::Rect& area, bool displaced) {
    cv::Mat image(area.size(), CV_32FC3);
    for (int y = 0; y < area.height; ++y)
      for (int x = 0; x < area.width; ++x)
        for (std::size_t k = 0; k < 3; ++k) {
          const Vec2 pixel(x + area.x, y + area.y);
          const Vec2 at =
              displaced ? camera.color_registration.from_color(k, camera, pixel) : pixel;
          image.at<cv::Vec3f>(y, x)[static_cast<int>(k)] = static_cast<float>(value(at));
        }
    return image;
  };
  for (const cv::Rect area : {cv::Rect(0, 0, 200, 150), cv::Rect(37, 21, 90, 80)}) {
    const cv::Mat result = registered(camera, draw(area, true), area.tl());
    const cv::Mat expected = draw(area, false);
    const cv::Rect inside(5, 5, area.width - 10, area.height - 10);
    EXPECT_LT(cv::norm(result(inside), expected(inside), cv::NORM_INF), 0.02);
  }
  camera.color_registration = {};
  const cv::Mat image = draw({0, 0, 200, 150}, false);
  EXPECT_EQ(registered(camera, image).data, image.data);  // nothing stated: nothing copied
}

TEST(RegisteredPatterns, LinesMoveWithTheColourThatShowsThem) {
  Rig rig = two_color_rig(200, 150);
  auto& registration = rig.projectors[0].color_registration;
  registration.colors[0].shift_px = Vec2(9, 9);  // red: no line of this projector
  registration.colors[2] = {Vec2(0.5, 7), 1.002};
  const LinePattern& before = rig.projectors[0].patterns[0];
  const Rig located = with_registered_patterns(rig);
  const LinePattern& after = located.projectors[0].patterns[0];
  for (const int line : {0, 3}) {
    const Vec2 shown(before.position_px(line), 0);
    EXPECT_NEAR(after.position_px(line), registration.from_color(2, rig.projectors[0], shown).x(),
                1e-12);
  }
  EXPECT_EQ(located.projectors[1].patterns[0].offset_px, rig.projectors[1].patterns[0].offset_px);
  // Spent: once more changes nothing.
  EXPECT_TRUE(located.projectors[0].color_registration.none());
  EXPECT_EQ(with_registered_patterns(located).projectors[0].patterns[0].offset_px, after.offset_px);
}

/// A curve of `count` points a pixel apart from `from` on, as a fit would leave it.
Curve straight_curve(Eigen::Vector2f from, double angle, int count, float amplitude) {
  Curve curve;
  const Eigen::Vector2f way(static_cast<float>(std::cos(angle)),
                            static_cast<float>(std::sin(angle)));
  for (int i = 0; i < count; ++i) {
    CurvePoint& p = curve.points.emplace_back();
    p.position = from + static_cast<float>(i) * way;
    p.normal = {way.y(), -way.x()};
    p.amplitude = amplitude;
    p.width_px = 0.9F;
  }
  return curve;
}

TEST(Ghosts, DiagonalsOfALatticeGoAndItsLinesStay) {
  using std::numbers::pi;
  std::vector<TestLine> lines;
  for (int k = 0; k < 16; ++k) {
    lines.push_back({.x = 0, .y = 10.0 + 8 * k, .angle = 0, .width = 2.5});
    lines.push_back({.x = 10.0 + 8 * k, .y = 0, .angle = pi / 2, .width = 2.5});
  }
  cv::Mat presence;
  cv::extractChannel(draw(lines, 140, 140, 0.02), presence, 2);
  const Curve line = straight_curve({50, 12}, pi / 2, 60, 0.45F);
  const Curve faint = straight_curve({12, 66}, 0, 60, 0.6F);  // fitted a third too high
  const Curve ghost = straight_curve({18, 18}, pi / 4, 90, 0.3F);
  Curve turning = straight_curve({50, 14}, pi / 2, 60, 0.45F);
  const Curve away = straight_curve({50, 74}, pi / 4, 60, 0.3F);
  turning.points.insert(turning.points.end(), away.points.begin(), away.points.end());
  const std::vector<Curve> kept = without_ghosts(presence, {line, faint, ghost, turning}, 6);
  ASSERT_EQ(kept.size(), 3U);
  EXPECT_EQ(kept[0].points.size(), line.points.size());
  EXPECT_EQ(kept[1].points.size(), faint.points.size());
  EXPECT_NEAR(static_cast<double>(kept[2].points.size()), 60, 8);
  EXPECT_NEAR(static_cast<double>(kept[2].points.front().position.y()), 14, 1e-3);
}

}  // namespace
}  // namespace pencilscan
