#include "pencilscan/io/png.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <string>

#include "pencilscan/core/random.h"
#include "pencilscan/io/codec.h"
#include "pencilscan/io/png_fixture.h"

namespace pencilscan {
namespace {

using sample::png_file;
using sample::PngHeader;

std::size_t row_bytes(const PngHeader& header) {
  return static_cast<std::size_t>(header.width * (header.color == 2 ? 3 : 1) * header.bits / 8);
}

/// Rows of chance bytes, of all filters in turn: any bytes are filtered rows of some picture.
std::string chance_rows(const PngHeader& header) {
  Random random(7);
  std::string rows;
  for (int y = 0; y < header.height; ++y) {
    rows += static_cast<char>((y + 4) % 5);  // the first row has one that looks at the row above
    for (std::size_t i = 0; i < row_bytes(header); ++i)
      rows += static_cast<char>(random.uniform(0, 256));
  }
  return rows;
}

cv::Mat by_opencv(const std::string& file) {
  return decoded_picture(file, cv::IMREAD_ANYDEPTH | cv::IMREAD_ANYCOLOR);
}

TEST(PlainPng, OfAnyFilterIsWhatOpenCvReads) {
  for (const int bits : {8, 16}) {
    for (const int color : {0, 2}) {
      const PngHeader header{.width = 37, .height = 23, .bits = bits, .color = color};
      const std::string file = png_file(header, chance_rows(header));
      const auto image = plain_png(file);
      const cv::Mat expected = by_opencv(file);
      ASSERT_TRUE(image) << bits << " " << color;
      ASSERT_EQ(image->type(), expected.type());
      ASSERT_EQ(image->size(), expected.size());
      EXPECT_EQ(cv::norm(*image, expected, cv::NORM_INF), 0) << bits << " " << color;
      const auto shape = sound_png_shape(file);
      ASSERT_TRUE(shape);
      EXPECT_EQ(shape->width, 37);
      EXPECT_EQ(shape->height, 23);
      EXPECT_EQ(shape->channels, expected.channels());
    }
  }
}

TEST(PlainPng, LeavesOthersAlone) {
  const PngHeader header{.width = 9, .height = 5};
  const std::string rows = chance_rows(header);
  EXPECT_TRUE(plain_png(png_file(header, rows)));
  EXPECT_TRUE(plain_png(png_file(header, rows, sample::png_chunk("tEXt", "Title"))));
  EXPECT_FALSE(plain_png(png_file(header, rows, sample::png_chunk("tRNS", "\1\1\1\1\1\1"))));
  EXPECT_FALSE(plain_png(png_file(header, rows, sample::png_chunk("PLTE", "abc"))));
  PngHeader other = header;
  other.interlace = 1;
  EXPECT_FALSE(plain_png(png_file(other, rows)));
  other = header;
  other.color = 6;
  EXPECT_FALSE(plain_png(png_file(other, rows)));
  EXPECT_FALSE(plain_png("a text"));
}

TEST(PlainPng, BrokenOnesAreNone) {
  const PngHeader header{.width = 9, .height = 5};
  const std::string rows = chance_rows(header);
  const std::string file = png_file(header, rows);
  for (std::size_t i = 0; i < file.size(); ++i) {
    std::string broken = file;
    broken[i] = static_cast<char>(broken[i] ^ 1);
    EXPECT_FALSE(plain_png(broken)) << i;
    EXPECT_FALSE(plain_png(file.substr(0, i))) << i;
  }
  EXPECT_FALSE(plain_png(png_file(header, rows.substr(1))));
  EXPECT_FALSE(plain_png(png_file(header, rows + "x")));
  EXPECT_FALSE(plain_png(png_file(header, "\5" + rows.substr(1)))) << "no such filter";
  PngHeader huge = header;
  huge.width = huge.height = 30000;
  EXPECT_FALSE(plain_png(png_file(huge, rows))) << "more pixels than the data can hold";
}

}  // namespace
}  // namespace pencilscan
