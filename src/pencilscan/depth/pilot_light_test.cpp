#include "pencilscan/depth/pilot_light.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pencilscan/core/random.h"
#include "pencilscan/depth/window_model.h"

namespace pencilscan {
namespace {

TEST(BestBlur, IsThatOfTheLinesThatAreShown) {
  constexpr int kHalf = 8;
  constexpr double kSection = 0.16;  // px, half of what golden section leaves
  const Vec2 pixel(118, 104);
  for (const double blur_px : {0.5, 0.8, 1.2, 1.8}) {
    WindowModel model(kHalf, pixel, 2, blur_px);
    const Quadric truth = model.plane(570, {0.2, -0.3, -1});
    model.show(truth, {{0.5, 0.4}, {0.1, 0.05}, {Vec2::Zero(), Vec2::Zero()}});
    const PilotWindow pilot{pixel, truth};
    for (const float before : {0.4F, 2.F}) {
      model.light().blur_px = before;
      EXPECT_NEAR(double{best_blur({&pilot, 1}, kHalf, model.light())}, blur_px, kSection);
    }
  }
}

/// Windows of a hundred pixels, whose mean values lie between `low` and `high`.
std::vector<NoiseSample> noisy_windows(std::size_t count, double low, double high,
                                       const NoiseModel& noise) {
  constexpr int kPixels = 100;
  Random random(11);
  std::vector<NoiseSample> samples;
  for (std::size_t i = 0; i < count; ++i) {
    const auto mean = static_cast<float>(random.uniform(low, high));
    const double deviation = std::sqrt(double{noise.variance(mean)});
    double squares = 0;
    for (int k = 0; k < kPixels; ++k) squares += std::pow(random.normal(0, deviation), 2);
    samples.push_back({mean, static_cast<float>(squares / kPixels)});
  }
  return samples;
}

TEST(NoiseOf, WindowsIsTheLineThatTheirVariancesLieOn) {
  const NoiseModel truth{2e-5F, 4e-4F};
  const auto found = noise_of(noisy_windows(400, 0.02, 0.6, truth));
  ASSERT_TRUE(found);
  // A window's variance scatters by 14 %, the median of 200 by 1.25 * 14 % / sqrt(200).
  constexpr float kMedian = 0.013F;
  for (const float value : {0.15F, 0.45F})  // the middles of the halves
    EXPECT_NEAR(found->variance(value) / truth.variance(value), 1, 4 * kMedian) << value;
  EXPECT_NEAR(found->slope / truth.slope, 1, 0.1);
}

TEST(NoiseOf, WindowsOfOneBrightnessHasNoSlope) {
  const auto found = noise_of(noisy_windows(200, 0.3, 0.3, {1e-4F, 0}));
  ASSERT_TRUE(found);
  EXPECT_EQ(found->slope, 0);
  EXPECT_NEAR(found->offset / 1e-4F, 1, 0.1);
}

TEST(NoiseOf, WindowsThatAreTooFewOrDarkerWhereNoisierIsNotExtrapolated) {
  std::vector<NoiseSample> samples = noisy_windows(19, 0.1, 0.5, {1e-4F, 0});
  EXPECT_FALSE(noise_of(samples));
  samples = noisy_windows(20, 0.1, 0.5, {1e-4F, 0});
  EXPECT_TRUE(noise_of(samples));
  for (NoiseSample& sample : samples) sample.variance = 2e-4F - 3e-4F * sample.mean;
  EXPECT_EQ(noise_of(samples)->slope, 0);
  // A line that would be negative in the dark keeps a fifth of the dark windows' variance.
  for (NoiseSample& sample : samples) sample.variance = sample.mean < 0.3F ? 1e-5F : 1e-3F;
  EXPECT_FLOAT_EQ(noise_of(samples)->offset, 0.2F * 1e-5F);
  // Windows without any noise are not exact.
  for (NoiseSample& sample : samples) sample.variance = 0;
  EXPECT_FLOAT_EQ(noise_of(samples)->offset, 1e-7F);
}

TEST(MeasuredLight, StaysAsItIsWithoutWindowsThatFit) {
  WindowModel model(8, {118, 104}, 2);
  CameraLight light = model.light();
  light.blur_px = 1.1F;
  const PilotWindow pilot{{118, 104}, model.plane(570, {0, 0, -1})};  // of a dark picture
  measure_light({&pilot, 1}, 8, light);
  EXPECT_EQ(light.blur_px, 1.1F);
  EXPECT_FALSE(light.is_measured);
  EXPECT_EQ(light.noise[0].offset, model.light().noise[0].offset);
  measure_light({}, 8, light);
  EXPECT_EQ(light.blur_px, 1.1F);
}

}  // namespace
}  // namespace pencilscan
