#include "pencilscan/detection/missing_channels.h"

#include <gtest/gtest.h>

#include "pencilscan/pattern/de_bruijn.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

constexpr float kSpacing = 12;
constexpr int kLines = 24;
constexpr int kLength = 400;
constexpr float kCertain = -4;  ///< evidence against the colour that a line does not show

/// Lines of blue and cyan across a picture; left of `edge` all of them look blue.
class MissingChannelsTest : public ::testing::Test {
 protected:
  MissingChannelsTest() {
    const Rig rig = sample::two_by_two(
        sample::device_at<Camera>({1100, -250, 150}, "cam0", 1280, 960, 2300),
        sample::device_at<Projector>({1000, 500, 100}, "proj0", 1280, 1024, 2400),
        sample::device_at<Projector>({857, -312, 615}, "proj1", 1280, 1024, 2400), 150);
    families_ = color_families(rig);
    const std::vector<PatternColor>& colors = families_[0].colors;
    EXPECT_EQ(colors.size(), 2U);
    cyan_ = is_rest_of(colors[0], colors[1]) ? 1 : 0;
    EXPECT_TRUE(is_rest_of(colors[1 - cyan_], colors[cyan_]));
  }

  /// Evidence against being cyan of each line that looks blue, at a place along the lines: of those
  /// that are cyan, and of those that are blue.
  void look_at(int edge, int place) {
    std::vector<Curve> curves;
    const std::vector<int> code = de_bruijn_sequence(2, 3);
    for (int line = 0; line < kLines; ++line) {
      Curve& curve = curves.emplace_back();
      curve.family = 0;
      for (int x = 0; x < kLength; ++x) {
        CurvePoint point;
        point.position = {static_cast<float>(x), kSpacing * (static_cast<float>(line) + 0.5F)};
        curve.points.push_back(point);
        const bool is_cyan = code[static_cast<std::size_t>(line) % code.size()] == 1;
        const std::size_t looks = is_cyan && x >= edge ? cyan_ : 1 - cyan_;
        for (std::size_t k = 0; k < 2; ++k) curve.code.push_back(k == looks ? 0 : kCertain);
      }
    }
    const std::vector<Curve> before = curves;
    allow_for_missing_channels(families_, {kLength, static_cast<int>(kLines * kSpacing)}, kSpacing,
                               curves);
    of_cyan_.clear();
    of_blue_.clear();
    for (int line = 4; line < kLines - 4; ++line) {
      const auto l = static_cast<std::size_t>(line);
      const auto at = 2 * static_cast<std::size_t>(place);
      const bool is_cyan = code[l % code.size()] == 1;
      if (before[l].code[at + cyan_] == 0) {  // looks cyan: nothing makes a blue line so
        EXPECT_EQ(curves[l].code[at + cyan_], 0);
        EXPECT_EQ(curves[l].code[at + 1 - cyan_], kCertain);
      } else {
        EXPECT_EQ(curves[l].code[at + 1 - cyan_], 0);
        (is_cyan ? of_cyan_ : of_blue_).push_back(curves[l].code[at + cyan_]);
      }
    }
  }

  std::vector<ColorFamily> families_;
  std::size_t cyan_ = 0;
  std::vector<float> of_cyan_;
  std::vector<float> of_blue_;
};

TEST_F(MissingChannelsTest, OnAWhiteSurfaceBlueStaysBlue) {
  look_at(0, kLength / 2);
  EXPECT_TRUE(of_cyan_.empty());
  ASSERT_GT(of_blue_.size(), 4U);
  for (const float evidence : of_blue_) EXPECT_LT(evidence, 0.9F * kCertain);
}

TEST_F(MissingChannelsTest, WhereNothingIsGreenBlueMayBeCyan) {
  look_at(kLength, kLength / 2);
  ASSERT_GT(of_cyan_.size(), 4U);
  for (const float evidence : of_cyan_) EXPECT_GT(evidence, -0.1F);
  for (const float evidence : of_blue_) EXPECT_GT(evidence, -0.1F);
}

TEST_F(MissingChannelsTest, EachPlaceIsJudgedByTheLinesAround) {
  constexpr int kSix = static_cast<int>(6 * kSpacing);
  look_at(kLength / 2, kLength / 2 - kSix);
  ASSERT_GT(of_cyan_.size(), 4U);
  for (const float evidence : of_cyan_) EXPECT_GT(evidence, -0.1F);
  look_at(kLength / 2, kLength / 2 + kSix);
  ASSERT_GT(of_blue_.size(), 4U);
  for (const float evidence : of_blue_) EXPECT_LT(evidence, 0.8F * kCertain);
}

}  // namespace
}  // namespace pencilscan
