#include "pencilscan/simulation/sensor.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pencilscan/simulation/panel_light.h"

namespace pencilscan {
namespace {

TEST(ApplySensor, NoiseHasTheVarianceOfTheModel) {
  SensorOptions options;
  options.full_well = 6000;
  options.read_noise = 1.5;
  options.bit_depth = 16;
  for (const double value : {0.05, 0.2, 0.7}) {
    const cv::Mat flat(300, 300, CV_32FC1, cv::Scalar(value));
    cv::Mat stored;
    apply_sensor(flat, options).convertTo(stored, CV_64F, 1 / 65535.0);
    cv::Scalar mean;
    cv::Scalar deviation;
    cv::meanStdDev(stored, mean, deviation);
    const double sigma = std::hypot(std::sqrt(value * 6000) / 6000, 1.5 / 255);
    // 90,000 samples: the mean is good to sigma / 300, the deviation to 0.24 %; four of each.
    EXPECT_NEAR(mean[0], value, 4 * sigma / 300);
    EXPECT_NEAR(deviation[0], sigma, 0.01 * sigma);
  }
}

TEST(ApplySensor, WithoutEffectsIsRounding) {
  cv::Mat ramp(1, 256, CV_32FC1);
  for (int i = 0; i < 256; ++i) ramp.at<float>(0, i) = static_cast<float>(i / 255.0);
  const cv::Mat stored = apply_sensor(ramp, {});
  for (int i = 0; i < 256; ++i) EXPECT_EQ(stored.at<std::uint8_t>(0, i), i);
}

TEST(ApplySensor, GammaIsUndoneByThePowerOfTheRig) {
  SensorOptions options;
  options.gamma = 2.2;
  options.bit_depth = 16;
  const cv::Mat flat(2, 2, CV_32FC3, cv::Scalar(0.1, 0.4, 0.9));
  const auto stored = apply_sensor(flat, options).at<cv::Vec<std::uint16_t, 3>>(1, 1);
  EXPECT_NEAR(std::pow(stored[0] / 65535.0, 2.2), 0.1, 1e-4);  // 16-bit rounding
  EXPECT_NEAR(std::pow(stored[2] / 65535.0, 2.2), 0.9, 1e-4);
}

TEST(ApplySensor, BlurKeepsLightAndSpreadsItByItsVariance) {
  SensorOptions options;
  options.blur_px = 0.7;
  options.bit_depth = 16;
  cv::Mat dot(21, 21, CV_32FC1, cv::Scalar(0));
  dot.at<float>(10, 10) = 1;
  const cv::Mat stored = apply_sensor(dot, options);
  double sum = 0;
  double spread = 0;
  for (int y = 0; y < 21; ++y) {
    for (int x = 0; x < 21; ++x) {
      const double v = stored.at<std::uint16_t>(y, x) / 65535.0;
      sum += v;
      spread += v * (x - 10) * (x - 10);
    }
  }
  EXPECT_NEAR(sum, 1, 1e-3);
  EXPECT_NEAR(spread / sum, 0.49, 0.01);  // a sampled Gaussian of 0.7 px, cut at 4 sigma
}

TEST(ApplySensor, MosaicKeepsOneColourAPixelAboveItsBlackLevel) {
  SensorOptions options;
  options.mosaic = Mosaic::from_name("RGGB");
  options.black_level = 0.1;
  options.bit_depth = 16;
  const cv::Mat flat(4, 4, CV_32FC3, cv::Scalar(0.2, 0.4, 0.6));
  const cv::Mat raw = apply_sensor(flat, options);
  ASSERT_EQ(raw.type(), CV_16UC1);
  const auto linear = [&](int x, int y) {
    return (raw.at<std::uint16_t>(y, x) / 65535.0 - 0.1) / 0.9;
  };
  EXPECT_NEAR(linear(0, 0), 0.2, 1e-4);
  EXPECT_NEAR(linear(1, 0), 0.4, 1e-4);
  EXPECT_NEAR(linear(2, 3), 0.4, 1e-4);
  EXPECT_NEAR(linear(3, 3), 0.6, 1e-4);
}

TEST(ApplySensor, InterpolatedColoursHaveLessNoiseThanTheirSamples) {
  SensorOptions options;
  options.mosaic = Mosaic::from_name("RGGB");
  options.interpolated = true;
  options.full_well = 6000;
  options.bit_depth = 16;
  const cv::Mat flat(300, 300, CV_32FC3, cv::Scalar(0.3, 0.3, 0.3));
  cv::Mat picture;
  apply_sensor(flat, options).convertTo(picture, CV_64F, 1 / 65535.0);
  ASSERT_EQ(picture.channels(), 3);
  double of_samples = 0;
  double between = 0;  // the mean of four samples
  for (int y = 1; y < 299; ++y) {
    for (int x = 1; x < 299; ++x) {
      const double error = picture.at<cv::Vec3d>(y, x)[0] - 0.3;
      if (x % 2 == 0 && y % 2 == 0) of_samples += error * error;
      if (x % 2 == 1 && y % 2 == 1) between += error * error;
    }
  }
  EXPECT_NEAR(between / of_samples, 0.25, 0.015);  // 22,201 samples each: good to 1 %, correlated
}

TEST(CrosstalkMatrix, KeepsGreyAndReproducesTheDocumentedRows) {
  const Mat3 matrix = crosstalk_matrix(0.08);
  EXPECT_LT((matrix * Vec3::Ones() - Vec3::Ones()).norm(), 1e-12);
  EXPECT_LT((matrix.row(0) - Eigen::RowVector3d(0.92, 0.06, 0.02)).norm(), 1e-12);
  EXPECT_LT((matrix.row(1) - Eigen::RowVector3d(0.04, 0.92, 0.04)).norm(), 1e-12);
}

TEST(PanelProfile, BlurMatchesTheClosedFormOfABox) {
  const PanelProfile box(Axis::kColumn, {0, 48, 52, 100},
                         {Vec3::Zero(), Vec3::Ones(), Vec3::Zero()});
  const PanelProfile soft = box.blurred(1.3);
  const auto cdf = [](double t) { return 0.5 * std::erfc(-t / std::sqrt(2.0)); };
  for (double x = 44; x < 56; x += 0.37) {
    const double expected = cdf((x - 48) / 1.3) - cdf((x - 52) / 1.3);
    EXPECT_NEAR(soft.mean(x, 0.0625).x(), expected, 2e-3);  // cells of 1/16 px
  }
  EXPECT_NEAR(soft.mean(50, 90).x() * 90, 4, 1e-6);
  EXPECT_DOUBLE_EQ(box.mean(48, 2).x(), 0.5);
}

TEST(LineLight, PixelatedFilmEqualsThePanelImage) {
  Projector projector;
  projector.width = 200;
  projector.height = 100;
  LinePattern pattern;
  pattern.pitch_px = 9.7;
  pattern.line_width_px = 3.3;
  projector.patterns = {pattern};
  const cv::Mat image = render_patterns(projector.patterns, 200, 100);
  FilmOptions film;
  film.pixelated = true;
  const PanelLight pixels = line_light(projector, film);
  const PanelLight continuous = line_light(projector);
  for (int x = 0; x < 200; ++x) {
    const double expected = image.at<cv::Vec3f>(50, x)[2];
    EXPECT_NEAR(pixels.at(Vec2(x, 50), Vec2(0.2, 0.2)).z(), expected, 1e-6);
    EXPECT_NEAR(continuous.at(Vec2(x, 50), Vec2(1, 1)).z(), expected, 1e-6);
  }
}

}  // namespace
}  // namespace pencilscan
