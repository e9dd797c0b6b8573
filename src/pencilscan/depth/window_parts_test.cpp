// Against draws of noise: what is told of a part must not hang on how many samples it has.
#include "pencilscan/depth/window_parts.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include "pencilscan/core/random.h"

namespace pencilscan {
namespace {

/// Shares of windows whose middle is called dark, with the light that is predicted everywhere and
/// without the middle's.
struct CalledDark {
  double lit = 0, dark = 0;
};

/// Every `step`-th pixel of the windows has a sample. `energy`: of the light predicted in the
/// middle, squares over the variance of the noise.
CalledDark middles_called_dark(float energy, std::size_t step, Random& random) {
  constexpr int kDraws = 1000;
  const WindowGrid grid(6);
  const std::vector<float> profile(grid.padded, 1.F);
  std::vector<float> weight(grid.padded, 0.F);
  std::vector<char> is_middle(grid.padded, 0);
  float samples = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(grid.count); ++i) {
    const float x = grid.monomial(1)[i];
    const float y = grid.monomial(2)[i];
    is_middle[i] = x * x + y * y < 0.2F ? 1 : 0;  // of the parts
    if (i % step == 0) weight[i] = 1;
    if (is_middle[i] != 0) samples += weight[i];
  }
  const float certainty = energy / samples;
  const float noise = 1 / std::sqrt(certainty);
  FamilyLight light;
  light.patterns = 1;
  light.profile = {profile.data()};
  light.amplitude = {1.F};
  WindowParts parts(grid);
  const auto is_called_dark = [&](float middle) {
    std::vector<float> image(grid.padded, 0.F);
    for (std::size_t i = 0; i < grid.padded; ++i)
      image[i] = (is_middle[i] != 0 ? middle : 1.F) + noise * static_cast<float>(random.normal());
    parts.reset();
    parts.add(light, image.data(), weight.data(), certainty);
    parts.sum_up();
    return parts.is_middle_dark();
  };
  CalledDark share;
  for (int k = 0; k < kDraws; ++k) {
    share.lit += is_called_dark(1) ? 1.0 / kDraws : 0;
    share.dark += is_called_dark(0) ? 1.0 / kDraws : 0;
  }
  return share;
}

TEST(WindowParts, WhatFewSamplesShowAsDarkIsDarkAndNoiseIsNot) {
  Random random(11);
  struct Case {
    float energy;
    double least_told;  // of dark middles; a normal deviate leaves .747, .976 and 1
  };
  for (const auto& [energy, least_told] : {Case{10, 0.70}, Case{20, 0.95}, Case{80, 0.99}}) {
    for (const std::size_t step : {std::size_t{1}, std::size_t{4}}) {
      const CalledDark share = middles_called_dark(energy, step, random);
      EXPECT_LT(share.lit, 0.015) << energy << ' ' << step;  // 2.5 deviations: .006
      EXPECT_GT(share.dark, least_told) << energy << ' ' << step;
    }
  }
}

/// The edge that is found in a window of lines 4 px apart, lit up to `offset` px along the angle.
std::optional<WindowParts::Edge> edge_of(double angle, float offset, Random& random) {
  constexpr float kNoise = 0.1F;  // of the light
  const WindowGrid grid(8);
  std::vector<float> profile(grid.padded, 0.F), image(grid.padded, 0.F), weight(grid.padded, 0.F);
  for (std::size_t i = 0; i < static_cast<std::size_t>(grid.count); ++i) {
    const float x = 8 * grid.monomial(1)[i];
    const float y = 8 * grid.monomial(2)[i];
    const auto lines = [](float at) { return 0.5F + 0.5F * std::cos(1.5708F * at); };
    const auto out =
        x * static_cast<float>(std::cos(angle)) + y * static_cast<float>(std::sin(angle));
    profile[i] = lines(0.6F * x + 0.8F * y);
    image[i] = (out > offset ? 0 : profile[i]) + kNoise * static_cast<float>(random.normal());
    weight[i] = 1;
  }
  FamilyLight light;
  light.patterns = 1;
  light.profile = {profile.data()};
  light.amplitude = {1.F};
  WindowParts parts(grid);
  parts.reset();
  parts.add(light, image.data(), weight.data(), 1 / (kNoise * kNoise));
  parts.sum_up();
  return parts.edge(1);
}

TEST(WindowParts, TheEdgeOfTheLightIsFoundWithinTheGapOfLines) {
  Random random(12);
  for (const float offset : {1.F, 3.F, 5.F}) {
    for (int k = 0; k < 24; ++k) {
      const double angle = k * std::numbers::pi / 12;
      const auto edge = edge_of(angle, offset, random);
      ASSERT_TRUE(edge) << offset << ' ' << k;
      // Lines 4 px apart leave the edge open within the dark between them, and its direction with
      // it.
      const double along = std::cos(angle) * static_cast<double>(edge->cosine) +
                           std::sin(angle) * static_cast<double>(edge->sine);
      EXPECT_GT(along, 0.8) << offset << ' ' << k;
      EXPECT_NEAR(edge->offset, offset, 2) << offset << ' ' << k;
    }
  }
}

// Of the hundreds of edges that a window might have, noise hardly ever makes one.
TEST(WindowParts, WhatIsLitHasNoEdgeButByNoise) {
  Random random(13);
  int found = 0;
  for (int draw = 0; draw < 200; ++draw) found += edge_of(0, 100, random) ? 1 : 0;
  EXPECT_LE(found, 2);
}

}  // namespace
}  // namespace pencilscan
