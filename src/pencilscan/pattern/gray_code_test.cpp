#include "pencilscan/pattern/gray_code.h"

#include <gtest/gtest.h>

#include <bit>

namespace pencilscan {
namespace {

TEST(GrayCode, NeighboursDifferInOneBitAndDecodeToThemselves) {
  for (std::uint32_t i = 0; i < 4096; ++i) {
    EXPECT_EQ(index_from_gray(gray_from_index(i)), i);
    EXPECT_EQ(std::popcount(gray_from_index(i) ^ gray_from_index(i + 1)), 1);
  }
}

TEST(GrayCode, BitsAreTheCeilingOfTheLogarithm) {
  EXPECT_EQ(gray_code_bits(1), 0);
  EXPECT_EQ(gray_code_bits(2), 1);
  EXPECT_EQ(gray_code_bits(1024), 10);
  EXPECT_EQ(gray_code_bits(1025), 11);
  EXPECT_EQ(gray_code_bits(1280), 11);
}

TEST(GrayCode, SequenceHasTheOrderOfTheCaptureFolders) {
  const auto sequence = gray_code_sequence(1280, 1024);
  ASSERT_EQ(sequence.size(), 44U);
  EXPECT_EQ(sequence[0].kind, GrayCodeImage::Kind::kWhite);
  EXPECT_EQ(sequence[1].kind, GrayCodeImage::Kind::kBlack);
  EXPECT_EQ(sequence[2].bit, 10);
  EXPECT_FALSE(sequence[2].inverse);
  EXPECT_TRUE(sequence[3].inverse);
  EXPECT_EQ(sequence[24].axis, Axis::kRow);
  EXPECT_EQ(sequence[24].bit, 9);
  EXPECT_EQ(gray_code_sequence(1280, 1024, false).size(), 23U);
}

TEST(GrayCode, PanelImagesDecodeToEveryPixel) {
  constexpr int kWidth = 37;
  constexpr int kHeight = 21;
  const auto sequence = gray_code_sequence(kWidth, kHeight);
  std::vector<cv::Mat> images;
  for (const auto& image : sequence) images.push_back(render_gray_code(image, kWidth, kHeight));
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      std::vector<std::uint8_t> bright;
      for (const auto& image : images) bright.push_back(image.at<std::uint8_t>(y, x));
      const GrayCodeIndex index = decode_gray_code(sequence, bright);
      EXPECT_EQ(index.column, x);
      EXPECT_EQ(index.row, y);
    }
  }
}

}  // namespace
}  // namespace pencilscan
