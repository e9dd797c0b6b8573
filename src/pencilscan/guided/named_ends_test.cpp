#include "pencilscan/guided/named_ends.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace pencilscan {
namespace {

constexpr LineName kLine{{1, 0}, 7};
constexpr int kMost = 4;

/// Points of a line down the picture, in rows [from, to).
Curve rows(float u, int from, int to) {
  Curve curve;
  for (int v = from; v < to; ++v) {
    CurvePoint p;
    p.position = {u, static_cast<float>(v)};
    p.amplitude = 0.4F;
    curve.points.push_back(p);
  }
  return curve;
}

/// A line with one name that is not seen in rows 50 to 52; below, its curve runs upwards.
class Gap : public testing::Test {
 protected:
  Gap() {
    camera_.width = camera_.height = 100;
    curves_ = {rows(30, 10, 50), rows(30, 53, 90)};
    std::reverse(curves_[1].points.begin(), curves_[1].points.end());
    for (CurvePoint& p : curves_[1].points) p.normal = -p.normal;
    for (int k = 0; k < 2; ++k) {
      const auto count = static_cast<int>(curves_[static_cast<std::size_t>(k)].points.size());
      runs_.push_back({k, 0, count, CurveLabel{kLine.pattern, kLine.line, 7, 1}});
    }
  }
  ContinuedLine continued(float guess_u, const LineName& name = kLine) const {
    return NamedEnds(camera_, curves_, runs_, subtracted_)
        .continued(rows(guess_u, 50, 53), name, kMost);
  }

  Camera camera_;
  std::vector<Curve> curves_;
  std::vector<LabeledRun> runs_;
  std::vector<char> subtracted_ = {1, 1};
};

TEST_F(Gap, IsContinuedByTheCurvesAroundIt) {
  const ContinuedLine line = continued(30);
  ASSERT_EQ(line.curve.points.size(), 3U + 2 * kMost);
  EXPECT_EQ(line.ends.size(), 2U);
  for (std::size_t i = 0; i < line.curve.points.size(); ++i) {
    const CurvePoint& p = line.curve.points[i];
    EXPECT_EQ(p.position.y(), 50 - kMost + static_cast<float>(i));
    EXPECT_EQ(p.normal, Eigen::Vector2f::UnitX());
    EXPECT_EQ(line.is_of_end(p), p.position.y() < 50 || p.position.y() > 52);
  }
  EXPECT_EQ(line.amplitude_within(), 0.4F);
}

TEST_F(Gap, GuessBesideTheLineIsMovedToIt) {
  for (const CurvePoint& p : continued(31).curve.points) EXPECT_NEAR(p.position.x(), 30, 1e-5);
}

TEST_F(Gap, AtOneEndTheGuessIsHeldThere) {
  runs_.pop_back();
  const ContinuedLine line = continued(31);
  ASSERT_EQ(line.curve.points.size(), 3U + kMost);
  EXPECT_NEAR(line.curve.points[kMost].position.x(), 30 + 1.F / (kMost + 1), 1e-5);
  EXPECT_NEAR(line.curve.points.back().position.x(), 30 + 3.F / (kMost + 1), 1e-5);
}

TEST_F(Gap, OtherLinesAndCurvesWithoutLightContinueNothing) {
  EXPECT_TRUE(continued(30, {{1, 0}, 8}).ends.empty());
  EXPECT_TRUE(continued(33).ends.empty());
  subtracted_ = {0, 0};
  const ContinuedLine line = continued(30);
  EXPECT_EQ(line.curve.points.size(), 3U);
  EXPECT_EQ(line.amplitude_within(), 0);
}

}  // namespace
}  // namespace pencilscan
