// Against a model of its own: derivatives by finite differences, optima by brute force.
#include "pencilscan/depth/window_fit.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <vector>

#include "pencilscan/depth/window_model.h"

namespace pencilscan {
namespace {

WindowLight some_light(std::size_t families) {
  WindowLight light{{0.5, 0.4}, {0.1, 0.05}, {{0.15, -0.1}, {-0.05, 0.12}}};
  light.offset.resize(families);
  light.tilt.resize(families);
  return light;
}

/// A slanted plane before the camera.
Quadric some_plane(const WindowModel& model, Random& random) {
  const Vec3 normal(random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5), -1);
  return model.plane(random.uniform(550, 590), normal);
}

/// The same, off by up to an eighth of a line, and tilted.
Quadric a_start_near(const WindowModel& model, const Quadric& q, Random& random) {
  const double of_line = 1 / std::abs(model.lines_per_w(0, q[0]));
  Quadric start = q;
  for (int c = 0; c < 3; ++c) start[c] += of_line * random.uniform(-0.125, 0.125);
  return start;
}

TEST(WindowFitter, FindsThePlaneThatMadeTheWindow) {
  Random random(3);
  for (const int half : {6, 8, 10}) {
    for (const int families : {1, 2}) {
      // So much blur that neighbouring lines meet, for the smaller windows.
      const double blur_px = half < 10 ? 2.0 : 0.8;
      WindowModel model(half, Vec2(100 + 5 * half, 95), families, blur_px);
      const Quadric truth = some_plane(model, random);
      model.show(truth, some_light(model.families()));
      const auto fit = model.settled_fit(a_start_near(model, truth, random));
      ASSERT_TRUE(fit);
      const double lines = std::abs(model.lines_per_w(0, truth[0]));
      // Single precision: w within 1e-7 of a coordinate of some dozen lines. The priors pull by
      // less.
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(lines * (fit->q[c] - truth[c]), 0, 1e-3) << c;
      for (int c = 3; c < 6; ++c) EXPECT_NEAR(lines * (fit->q[c] - truth[c]), 0, 1e-2) << c;
      EXPECT_LT(fit->misfit, 1e-2F);
      EXPECT_FALSE(fit->cut);
      EXPECT_EQ(fit->lit.count(), 2U);
      EXPECT_NEAR(fit->amplitude, 0.5F, 1e-2F);
    }
  }
}

// The bell is held as wide as it is at the optimum: the fitter lets it follow the slope between
// steps, not within. Less than 0.01 of chi^2 is less than a tenth of a standard deviation.
TEST(WindowFitter, NoNeighbourOfTheOptimumIsBetter) {
  Random random(4);
  for (const int families : {1, 2}) {
    WindowModel model(5, Vec2(120, 95), families);
    Quadric truth = some_plane(model, random);
    for (int c = 3; c < 6; ++c) truth[c] = random.uniform(-2e-6, 2e-6);  // a bow of 0.6 mm
    WindowLight light = some_light(model.families());
    model.show(truth, light);
    model.add_noise(random);
    const auto fit = model.settled_fit(a_start_near(model, truth, random));
    ASSERT_TRUE(fit);
    const auto reach = model.reach(fit->q);
    const double least = model.cost(fit->q, reach, light);
    const double sigma = std::sqrt(fit->variance);
    int checked = 0;
    for (const double step : {0.1 * sigma, sigma}) {
      for (int k = 0; k < 729; ++k) {
        Quadric q = fit->q;
        int digits = k;
        for (int c = 0; c < 6; ++c, digits /= 3) q[c] += (digits % 3 - 1) * step;
        if (k == 364) continue;  // no step at all
        WindowLight own = light;
        EXPECT_GT(model.cost(q, reach, own), least - 0.01) << k;
        ++checked;
      }
    }
    EXPECT_EQ(checked, 2 * 728);
  }
}

TEST(WindowFitter, UncertaintyIsThatOfFiniteDifferences) {
  Random random(5);
  for (const int families : {1, 2}) {
    WindowModel model(8, Vec2(118, 104), families);
    const Quadric truth = some_plane(model, random);
    WindowLight light = some_light(model.families());
    model.show(truth, light);
    model.add_noise(random);
    const auto fit = model.fit(truth);
    ASSERT_TRUE(fit);
    static_cast<void>(model.cost(fit->q, model.reach(fit->q), light));
    const WindowModel::Spread spread = model.spread(fit->q, light);
    const double inflate = std::max(1.0, static_cast<double>(fit->misfit));
    EXPECT_NEAR(fit->variance / (inflate * spread.variance), 1, 1e-2);
    const double slope = std::max(std::abs(model.lines_per_w(0, fit->q[0])),
                                  std::abs(model.lines_per_w(1, fit->q[0])));
    EXPECT_NEAR(static_cast<double>(fit->lines_per_w) / slope, 1, 1e-3);
  }
}

TEST(WindowFitter, APatternIsLitFromEightDeviationsOfItsAmplitudeOn) {
  Random random(9);
  for (const int families : {1, 2}) {
    WindowModel model(8, Vec2(118, 104), families);
    const Quadric truth = some_plane(model, random);
    WindowLight light = some_light(model.families());
    light.amplitude = {0.08, 0.04};  // more than the share of the largest that is asked, too
    const double least = 8 * std::sqrt(model.spread(truth, light).of_amplitude[1]);
    for (const double share : {0.9, 1.1}) {
      light.amplitude[1] = share * least;
      model.show(truth, light);
      const auto fit = model.settled_fit(truth);
      ASSERT_TRUE(fit);
      EXPECT_TRUE(fit->lit.test(0));
      EXPECT_EQ(fit->lit.test(1), share > 1) << families << " " << share;
    }
  }
}

TEST(WindowFitter, SigmaIsTheScatterOverDrawsOfNoise) {
  Random random(6);
  WindowModel model(7, Vec2(110, 90), 2);
  const Quadric truth = some_plane(model, random);
  const WindowLight light = some_light(2);
  constexpr int kDraws = 400;
  double sum = 0;
  double sum2 = 0;
  double variance = 0;
  double misfit = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    model.show(truth, light);
    model.add_noise(random);
    const auto fit = model.fit(truth);
    ASSERT_TRUE(fit);
    sum += fit->q[0] - truth[0];
    sum2 += std::pow(fit->q[0] - truth[0], 2);
    variance += fit->variance / kDraws;
    misfit += static_cast<double>(fit->misfit) / kDraws;
  }
  const WindowModel::Spread spread = model.spread(truth, light);
  const double scatter = std::sqrt(sum2 / kDraws);
  // A deviation of 400 draws is known to 1 / sqrt(800) = 3.5 %; three of that.
  EXPECT_NEAR(scatter / std::sqrt(spread.scatter2), 1, 0.11);
  EXPECT_LT(std::abs(sum / kDraws), 3 * scatter / std::sqrt(kDraws));
  // Weights below one hold pixels for noisier than they are: sigma is above the scatter, little.
  EXPECT_GT(std::sqrt(variance), 0.95 * scatter);
  EXPECT_LT(std::sqrt(variance), 1.25 * scatter);
  // Eight and four unknowns of some 150 values, twice, are fitted away.
  EXPECT_NEAR(misfit, 1 - 12.0 / (2.0 * static_cast<double>(model.size())), 0.03);
}

TEST(WindowFitter, ASideWithoutLightIsCutOffAndADarkMiddleIsNoSurface) {
  Random random(7);
  WindowModel model(8, Vec2(118, 104), 2);
  const Quadric truth = some_plane(model, random);
  const WindowLight light = some_light(2);
  const auto darken = [&](auto is_dark) {
    model.show(truth, light);
    model.add_noise(random);
    for (std::size_t f = 0; f < 2; ++f) {
      for (std::size_t i = 0; i < model.size(); ++i) {
        if (is_dark(model.place(i))) model.value(f, i) = static_cast<float>(light.offset[f]);
      }
    }
    return model.fit(truth);
  };
  const auto whole = darken([](const Vec2&) { return false; });
  ASSERT_TRUE(whole);
  EXPECT_FALSE(whole->cut);
  constexpr double kSideStart = 0.2;  // of the fitter
  for (int side = 0; side < 8; ++side) {
    const double angle = side * std::numbers::pi / 4;
    const Vec2 way(std::cos(angle), std::sin(angle));
    const auto cut = darken([&](const Vec2& x) { return x.dot(way) > kSideStart; });
    ASSERT_TRUE(cut) << side;
    EXPECT_TRUE(cut->cut) << side;
    EXPECT_LT(std::abs(cut->q[0] - truth[0]), 4 * std::sqrt(cut->variance)) << side;
    EXPECT_GT(cut->variance, 1.2 * whole->variance) << side;
    EXPECT_LT(cut->misfit, 1.5F) << side;  // what is dark does not count
  }
  EXPECT_FALSE(darken([](const Vec2& x) { return x.norm() < 0.5; }));
}

TEST(WindowFitter, DarknessBeyondAnEdgeDoesNotPullTheSurface) {
  Random random(12);
  WindowModel model(8, Vec2(118, 104), 2);
  const Quadric truth = some_plane(model, random);
  const WindowLight light = some_light(2);
  constexpr double kBlur = 0.8 / 8;  // radii, of the model
  for (const double offset : {0.35, 0.5, 0.65, 0.8}) {
    double sum = 0;
    for (int side = 0; side < 16; ++side) {
      const double angle = side * std::numbers::pi / 8 + 0.1;
      const Vec2 way(std::cos(angle), std::sin(angle));
      model.show(truth, light);
      for (std::size_t f = 0; f < 2; ++f) {
        for (std::size_t i = 0; i < model.size(); ++i) {
          const double beyond = (model.place(i).dot(way) - offset) / kBlur;
          const double covered = 0.5 * std::erfc(beyond / std::numbers::sqrt2);
          float& value = model.value(f, i);
          const auto dark = static_cast<float>(light.offset[f]);
          value = dark + static_cast<float>(covered) * (value - dark);
        }
      }
      const auto fit = model.fit(truth);
      ASSERT_TRUE(fit) << offset << ' ' << side;
      const double deviations = (fit->q[0] - truth[0]) / std::sqrt(fit->variance);
      // Edges between the directions that are tried leave a few half-dark pixels: 3 of 64 cases are
      // off by more than one deviation.
      EXPECT_LT(std::abs(deviations), 2.5) << offset << ' ' << side;
      sum += deviations / 16;
    }
    EXPECT_LT(std::abs(sum), 0.2) << offset;
  }
}

TEST(WindowFitter, PixelsThatAreSaturatedOrNotSampledSayNothing) {
  Random random(8);
  WindowModel model(8, Vec2(118, 104), 2);
  const Quadric truth = some_plane(model, random);
  model.show(truth, some_light(2));
  model.add_noise(random);
  CameraLight& light = model.light();
  light.sampled[1] = cv::Mat(light.valid.size(), CV_8UC1, cv::Scalar(255));
  for (std::size_t i = 0; i < model.size(); ++i) {
    if (i % 7 == 3) light.valid.at<std::uint8_t>(model.pixel_of(i)) = 0;
    if (i % 5 == 2) light.sampled[1].at<std::uint8_t>(model.pixel_of(i)) = 0;
  }
  const auto fit = model.fit(truth);
  ASSERT_TRUE(fit);
  EXPECT_LT(std::abs(fit->q[0] - truth[0]), 4 * std::sqrt(fit->variance));
  for (std::size_t i = 0; i < model.size(); ++i) {
    if (i % 7 == 3) model.value(0, i) = model.value(1, i) = 1;
    if (i % 5 == 2) model.value(1, i) = -3;
  }
  const auto same = model.fit(truth);
  ASSERT_TRUE(same);
  EXPECT_EQ(same->q, fit->q);
  EXPECT_EQ(same->variance, fit->variance);
  for (std::size_t i = 0; i < model.size(); ++i) {
    if (i % 9 < 5) light.valid.at<std::uint8_t>(model.pixel_of(i)) = 0;
  }
  EXPECT_FALSE(model.fit(truth));  // more than half
}

}  // namespace
}  // namespace pencilscan
