#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "pencilscan/pattern/de_bruijn.h"
#include "pencilscan/pattern/line_pattern.h"

namespace pencilscan {
namespace {

TEST(DeBruijn, LeastSequenceOfTwoSymbolsAndOrderThree) {
  EXPECT_THAT(de_bruijn_sequence(2, 3), testing::ElementsAre(0, 0, 0, 1, 0, 1, 1, 1));
}

TEST(DeBruijn, EveryWindowOccursOnce) {
  for (const auto& [alphabet, order] :
       std::vector<std::pair<int, int>>{{2, 3}, {2, 7}, {3, 4}, {5, 2}, {1, 3}}) {
    const std::vector<int> sequence = de_bruijn_sequence(alphabet, order);
    std::set<std::vector<int>> windows;
    for (std::size_t i = 0; i < sequence.size(); ++i) {
      std::vector<int> window;
      for (std::size_t k = 0; k < static_cast<std::size_t>(order); ++k) {
        window.push_back(sequence[(i + k) % sequence.size()]);
      }
      windows.insert(window);
    }
    EXPECT_EQ(windows.size(), sequence.size());
    EXPECT_EQ(sequence.size(), static_cast<std::size_t>(std::pow(alphabet, order)));
  }
}

TEST(LinePattern, CountsLinesWhoseCentresLieOnThePanel) {
  LinePattern pattern;
  EXPECT_EQ(pattern.line_count(1280), 107);
  EXPECT_EQ(pattern.line_count(1024), 85);
  pattern.max_lines = 5;
  EXPECT_EQ(pattern.line_count(1280), 5);
}

TEST(LinePattern, RenderedLinesHaveTheirWidthAsIntegral) {
  LinePattern pattern;
  pattern.pitch_px = 11.3;
  pattern.line_width_px = 3.4;
  pattern.offset_px = 5.2;
  const cv::Mat image = render_patterns({pattern}, 400, 8);
  const int lines = pattern.line_count(400);
  double blue = 0;
  for (int x = 0; x < 400; ++x) blue += image.at<cv::Vec3f>(3, x)[2];
  EXPECT_NEAR(blue, 3.4 * lines, 1e-3 + 3.4);  // the last line may be cut by the border
  EXPECT_EQ(image.at<cv::Vec3f>(0, 0), cv::Vec3f(0, 0, 0));
}

TEST(LinePattern, CoordinateInvertsPosition) {
  const LinePattern pattern;
  EXPECT_DOUBLE_EQ(pattern.coordinate(pattern.position_px(17.25)), 17.25);
}

}  // namespace
}  // namespace pencilscan
