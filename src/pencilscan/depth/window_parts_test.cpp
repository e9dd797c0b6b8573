// Against draws of noise: what is told of a part must not hang on how many samples it has.
#include "pencilscan/depth/window_parts.h"

#include <gtest/gtest.h>

#include <cmath>
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

}  // namespace
}  // namespace pencilscan
