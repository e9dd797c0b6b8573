#include "pencilscan/bundle/extra_variance.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pencilscan/core/random.h"

namespace pencilscan {
namespace {

/// The old rule, on beyond one deviation and off below it, made stated deviations of equal captures
/// differ by factors of 4 to 12.
TEST(ExtraVariance, GrowsSteadilyThroughWhatChanceExplains) {
  constexpr double kCount = 200;
  const double deviation = std::sqrt(2 / kCount);
  double before = mean_extra_variance(kCount * (1 - 3 * deviation), kCount, 1, 1);
  EXPECT_GT(before, 0);
  for (double squares = -2.5; squares < 3; squares += 0.5) {
    const double x = mean_extra_variance(kCount * (1 + squares * deviation), kCount, 1, 1);
    EXPECT_GT(x, before) << squares;
    EXPECT_LT(x, 2.5 * before) << squares;
    before = x;
  }
}

TEST(ExtraVariance, IsHalfADeviationOfChanceWhereChanceExplainsAll) {
  constexpr double kCount = 2000;
  // Gaussian likelihood: sqrt(2) Gamma(3/4) / Gamma(1/4).
  EXPECT_NEAR(mean_extra_variance(kCount, kCount, 1, 1) / std::sqrt(2 / kCount), 0.478, 0.03);
}

TEST(ExtraVariance, IsThatOfTheNumbersWhereItIsLarge) {
  Random random(1);
  constexpr double kChance = 0.5;
  constexpr double kGain = 3;
  constexpr double kVariance = 2;
  constexpr int kCount = 4000;
  double squares = 0;
  for (int i = 0; i < kCount; ++i)
    squares += std::pow(random.normal(0, std::sqrt(kChance + kGain * kVariance)), 2);
  EXPECT_NEAR(mean_extra_variance(squares, kCount, kChance, kGain), kVariance, 0.15);
}

TEST(ExtraVariance, OfFewNumbersIsNone) { EXPECT_EQ(mean_extra_variance(100, 3, 1, 1), 0); }

}  // namespace
}  // namespace pencilscan
