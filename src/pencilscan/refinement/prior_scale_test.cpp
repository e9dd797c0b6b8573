#include "pencilscan/refinement/prior_scale.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

namespace pencilscan {
namespace {

constexpr Eigen::Index kSize = 72;

/// Information of directions that data tell well to not at all.
Eigen::MatrixXd some_information() {
  Eigen::VectorXd values(kSize);
  for (Eigen::Index i = 0; i < kSize; ++i)
    values[i] = i < 7 ? 0 : std::pow(10, 6 * static_cast<double>(i - 7) / (kSize - 8) - 1);
  return values.asDiagonal();
}

/// What data find with the unit prior where corrections are N(0, scale^2).
Eigen::VectorXd found_with(const Eigen::MatrixXd& information, double scale, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Eigen::VectorXd found(kSize);
  for (Eigen::Index i = 0; i < kSize; ++i) {
    const double h = information(i, i);
    found[i] = (h * scale * normal(random) + std::sqrt(h) * normal(random)) / (h + 1);
  }
  return found;
}

TEST(LikelyPriorScale, IsThatOfTheCorrections) {
  const Eigen::MatrixXd information = some_information();
  for (const double scale : {0.03, 0.1, 0.3}) {
    for (unsigned seed = 1; seed <= 5; ++seed) {
      const double found = likely_prior_scale(information, found_with(information, scale, seed));
      EXPECT_GT(found, 0.6 * scale) << seed;
      EXPECT_LT(found, 1.6 * scale) << seed;
    }
  }
}

TEST(LikelyPriorScale, IsNextToNothingWhereNoiseExplainsAll) {
  const Eigen::MatrixXd information = some_information();
  for (unsigned seed = 1; seed <= 5; ++seed)
    EXPECT_LT(likely_prior_scale(information, found_with(information, 0, seed)), 0.005) << seed;
}

TEST(LikelyPriorScale, IsOneAtMost) {
  const Eigen::MatrixXd information = some_information();
  EXPECT_EQ(likely_prior_scale(information, found_with(information, 5, 1)), 1);
}

TEST(LikelyPriorScale, LeavesOutWhatIsApart) {
  const Eigen::MatrixXd information = some_information();
  Eigen::VectorXd found = found_with(information, 0.03, 1);
  const std::array<Eigen::Index, 3> apart = {60, 64, 68};
  for (const Eigen::Index i : apart) found[i] = 1;
  EXPECT_GT(likely_prior_scale(information, found), 0.1);
  EXPECT_LT(likely_prior_scale(information, found, apart), 0.05);
}

}  // namespace
}  // namespace pencilscan
