#include "pencilscan/io/image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>
#include <opencv2/core.hpp>

#include "pencilscan/io/file.h"
#include "pencilscan/io/io_fixture.h"
#include "pencilscan/io/linear_light.h"
#include "pencilscan/io/little_endian.h"
#include "pencilscan/io/mosaic.h"
#include "pencilscan/io/mosaic_light.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

cv::Mat test_image() {
  cv::Mat image(30, 40, CV_32FC3);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      image.at<cv::Vec3f>(y, x) = {float(x) / 39, float(y) / 29, float((x * 7 + y * 3) % 11) / 10};
    }
  }
  return image;
}

double max_difference(const cv::Mat& a, const cv::Mat& b) { return cv::norm(a, b, cv::NORM_INF); }

TEST_F(Io, PixelsThatAreNoNumbersAreRefused) {
  cv::Mat image(4, 6, CV_32FC1, cv::Scalar::all(0.5));  // of three channels OpenCV rounds
  write_image(folder_ / "a.tiff", image);
  EXPECT_EQ(error_of([&] { return read_image(folder_ / "a.tiff"); }), "");
  for (const float wrong : {std::nanf(""), INFINITY, -INFINITY}) {
    image.at<float>(2, 5) = wrong;
    write_image(folder_ / "a.tiff", image);
    EXPECT_THAT(error_of([&] { return read_image(folder_ / "a.tiff"); }),
                ::testing::HasSubstr("a.tiff: pixel = 5 2: must be a finite number"));
  }
}

TEST_F(Io, PngRoundTripKeepsRgbOrderAndDepth) {
  const cv::Mat image = test_image();
  for (const auto& [bits, step] : {std::pair{8, 1.0 / 255}, std::pair{16, 1.0 / 65535}}) {
    write_image(folder_ / "a.png", image, bits);
    const cv::Mat back = read_image(folder_ / "a.png");
    ASSERT_EQ(back.type(), CV_32FC3);
    // Rounding to the nearest step; float32 adds a little.
    EXPECT_LE(max_difference(back, image), 0.5 * step + 1e-6);
  }
}

TEST_F(Io, FloatTiffRoundTripIsExactAndGreyIsReplicated) {
  cv::Mat grey(5, 7, CV_32FC1);
  for (int i = 0; i < 35; ++i) grey.at<float>(i / 7, i % 7) = 0.01F * float(i) + 1e-6F;
  write_image(folder_ / "d.tiff", grey);
  const cv::Mat back = read_image(folder_ / "d.tiff");
  ASSERT_EQ(back.channels(), 3);
  cv::Mat channel;
  cv::extractChannel(back, channel, 2);
  EXPECT_EQ(max_difference(channel, grey), 0);
}

TEST_F(Io, AnImageThatIsDamagedBehindItsHeaderIsRejectedByItsName) {
  cv::Mat noise(200, 300, CV_8UC3);
  cv::randu(noise, 0, 255);
  write_image(folder_ / "n.png", noise);
  const auto size = static_cast<std::streamoff>(fs::file_size(folder_ / "n.png"));
  std::fstream file(folder_ / "n.png", std::ios::binary | std::ios::in | std::ios::out);
  file.seekp(size / 2);
  file << std::string(2000, '\0');
  file.close();
  EXPECT_THAT(error_of([&] { return read_image(folder_ / "n.png"); }),
              ::testing::HasSubstr("n.png"));
}

TEST_F(Io, TruncatedImagesAreRejectedAtEveryLength) {
  for (const char* name : {"a.png", "a.jpg", "a.bmp", "a.tiff"}) {
    for (const double share : {0.0, 0.01, 0.2, 0.5, 0.9, 0.99}) {
      write_image(folder_ / name, test_image());
      truncate(folder_ / name, share);
      const std::string message = error_of([&] { return read_image(folder_ / name); });
      EXPECT_THAT(message, ::testing::HasSubstr(name)) << share;
    }
  }
}

TEST_F(Io, SoundPngsAreToldByTheirChecksums) {
  const cv::Mat grey(30, 40, CV_8UC1, cv::Scalar(7));
  for (const auto& [image, bits, channels] :
       {std::tuple{test_image(), 8, 3}, std::tuple{test_image(), 16, 3}, std::tuple{grey, 8, 1}}) {
    write_image(folder_ / "a.png", image, bits);
    const std::optional<ImageShape> shape = sound_png(folder_ / "a.png");
    ASSERT_TRUE(shape);
    EXPECT_EQ(shape->width, 40);
    EXPECT_EQ(shape->height, 30);
    EXPECT_EQ(shape->channels, channels);
  }
  const std::string sound = read_file(folder_ / "a.png");
  for (std::size_t at = 12; at < sound.size(); ++at) {  // from the first chunk's type on
    std::string flipped = sound;
    flipped[at] = static_cast<char>(flipped[at] ^ 1);
    EXPECT_FALSE(sound_png(put("b.png", flipped))) << at;
    EXPECT_FALSE(sound_png(put("b.png", sound.substr(0, at)))) << at;
  }
  write_image(folder_ / "a.jpg", test_image());
  EXPECT_FALSE(sound_png(folder_ / "a.jpg"));
}

TEST_F(Io, WhatIsNoImageIsRejected) {
  EXPECT_THAT(error_of([&] { return read_image(put("a.png", "hello")); }),
              ::testing::HasSubstr("must be a PNG, TIFF, JPEG or BMP image"));
  EXPECT_THAT(error_of([&] { return read_image(folder_); }), ::testing::HasSubstr("folder"));
}

/// A TIFF of one RGB pixel in signed integers of 16 bits.
std::string signed_tiff() {
  struct Entry {
    std::uint16_t tag, type;  // type 3: 16 bits, 4: 32 bits
    std::uint32_t count, value;
  };
  constexpr std::uint32_t kEnd = 8 + 2 + 10 * 12 + 4;          // of header and entries
  const std::vector<Entry> entries = {{256, 4, 1, 1},          // width
                                      {257, 4, 1, 1},          // height
                                      {258, 3, 3, kEnd},       // bits per sample
                                      {259, 3, 1, 1},          // not compressed
                                      {262, 3, 1, 2},          // RGB
                                      {273, 4, 1, kEnd + 12},  // where the pixels are
                                      {277, 3, 1, 3},          // samples per pixel
                                      {278, 4, 1, 1},          // rows per strip
                                      {279, 4, 1, 6},          // bytes of the strip
                                      {339, 3, 3, kEnd + 6}};  // sample format
  std::string bytes = "II";
  append_little_endian<std::uint16_t>(bytes, 42);
  append_little_endian<std::uint32_t>(bytes, 8);
  append_little_endian(bytes, static_cast<std::uint16_t>(entries.size()));
  for (const Entry& entry : entries) {
    append_little_endian(bytes, entry.tag);
    append_little_endian(bytes, entry.type);
    append_little_endian(bytes, entry.count);
    append_little_endian(bytes, entry.value);
  }
  append_little_endian<std::uint32_t>(bytes, 0);
  for (const int value : {16, 16, 16, 2, 2, 2, 100, 200, 300})
    append_little_endian(bytes, static_cast<std::uint16_t>(value));
  return bytes;
}

TEST_F(Io, SignedPixelsAreRefusedByName) {
  write_text(folder_ / "a.tiff", signed_tiff());
  EXPECT_THAT(error_of([&] { return read_image(folder_ / "a.tiff"); }),
              ::testing::HasSubstr("a.tiff: must have 8 or 16 bit per channel"));
}

TEST_F(Io, FindImageTriesAllEndings) {
  EXPECT_FALSE(find_image(folder_, "cam0").has_value());
  put("cam0.jpeg", "x");
  EXPECT_EQ(find_image(folder_, "cam0"), folder_ / "cam0.jpeg");
}

TEST_F(Io, ImagesAreFoundWithEndingsInCapitals) {
  put("cam0.PNG", "x");
  put("CAM1.Jpeg", "x");
  EXPECT_EQ(find_image(folder_, "cam0"), folder_ / "cam0.PNG");
  EXPECT_EQ(find_image(folder_, "cam1"), std::nullopt);  // names are names
  EXPECT_EQ(find_image(folder_ / "none", "cam0"), std::nullopt);
}

TEST_F(Io, AFolderThatCannotBeListedHasNoLackOfImages) {
  fs::create_symlink("loop", folder_ / "loop");
  const std::string reason = "loop: cannot be listed: Too many levels of symbolic links";
  EXPECT_THAT(error_of([&] { return find_image(folder_ / "loop", "cam0"); }),
              ::testing::HasSubstr(reason));
  EXPECT_EQ(find_image(put("file", "x"), "cam0"), std::nullopt);
}

TEST_F(Io, AnImageThatCannotBeReachedIsFoundAndReadingItSaysWhy) {
  fs::create_symlink("cam0.png", folder_ / "cam0.png");
  const auto found = find_image(folder_, "cam0");
  ASSERT_EQ(found, folder_ / "cam0.png");
  EXPECT_THAT(error_of([&] { return read_image(*found); }),
              ::testing::HasSubstr("cam0.png: cannot be opened: Too many levels"));
}

TEST_F(Io, TwoImagesOfOneNameAreRefusedByName) {
  put("cam0.png", "x");
  put("cam0.jpg", "x");
  try {
    static_cast<void>(find_image(folder_, "cam0"));
    FAIL();
  } catch (const InputError& error) {
    EXPECT_EQ(error.value, "cam0.jpg and cam0.png");
  }
}

TEST(LinearLight, BlackIsTakenOutBeforeGamma) {
  cv::Mat image(1, 4, CV_32FC1);
  const float values[] = {0.05F, 0.1F, 0.55F, 1};
  std::copy_n(values, 4, image.ptr<float>());
  const cv::Mat light = linearized(image, 2, 0.1);
  const float expected[] = {0, 0, 0.25F, 1};
  for (int x = 0; x < 4; ++x) EXPECT_NEAR(light.at<float>(x), expected[x], 1e-6F);
  EXPECT_EQ(linearized(image, 1).data, image.data);
}

TEST(LinearLight, LeavesTheImageAsItIs) {
  for (const double black : {0.0, 0.1}) {
    const cv::Mat image(2, 2, CV_32FC3, cv::Scalar::all(0.5));
    static_cast<void>(linearized(image, 2.2, black));
    EXPECT_EQ(cv::norm(image, cv::Mat(2, 2, CV_32FC3, cv::Scalar::all(0.5)), cv::NORM_INF), 0);
  }
}

TEST(Mosaic, NamesSayWhatThePixelsSee) {
  for (const std::string name : {"RGGB", "BGGR", "GRBG", "GBRG"}) {
    const auto mosaic = Mosaic::from_name(name);
    ASSERT_TRUE(mosaic);
    EXPECT_EQ(mosaic->name(), name);
    for (int i = 0; i < 4; ++i)
      EXPECT_EQ("RGB"[mosaic->color(2 + i % 2, 4 + i / 2)], name[static_cast<std::size_t>(i)]);
  }
  EXPECT_FALSE(Mosaic::from_name("RGBG"));
}

/// Linear interpolation is exact where each colour is a plane, up to the border, where it mirrors.
TEST(Mosaic, PlanesOfColourComeBack) {
  cv::Mat image(11, 14, CV_32FC3);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const auto u = static_cast<float>(x);
      const auto v = static_cast<float>(y);
      image.at<cv::Vec3f>(y, x) = {0.1F + 0.01F * u, 0.5F - 0.02F * v, 0.3F + 0.01F * (u - v)};
    }
  }
  for (const char* name : {"RGGB", "BGGR", "GRBG", "GBRG"}) {
    const Mosaic mosaic = *Mosaic::from_name(name);
    const cv::Mat raw = sampled(image, mosaic);
    const cv::Mat back = demosaiced(raw, mosaic);
    EXPECT_EQ(cv::norm(sampled(back, mosaic), raw, cv::NORM_INF), 0);
    const cv::Rect inner(1, 1, image.cols - 2, image.rows - 2);
    EXPECT_LT(cv::norm(back(inner), image(inner), cv::NORM_INF), 1e-6);
    const cv::Mat light = light_behind(raw, mosaic);
    EXPECT_EQ(cv::norm(sampled(light, mosaic), raw, cv::NORM_INF), 0);
    const cv::Rect inside(3, 3, image.cols - 6, image.rows - 6);
    EXPECT_LT(cv::norm(light(inside), image(inside), cv::NORM_INF), 1e-6);
  }
}

/// Of lines 8 px apart, four samples of red and blue.
TEST(Mosaic, LinesFourSamplesApartKeepTheirContrast) {
  constexpr float kSpacing = 8;
  for (const bool down : {false, true}) {
    cv::Mat image(40, 48, CV_32FC3);
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        const float phase =
            static_cast<float>(down ? y : x) * 2 * std::numbers::pi_v<float> / kSpacing;
        image.at<cv::Vec3f>(y, x) = cv::Vec3f::all(0.5F + 0.4F * std::cos(phase));
      }
    }
    for (const char* name : {"RGGB", "BGGR", "GRBG", "GBRG"}) {
      const cv::Mat raw = sampled(image, *Mosaic::from_name(name));
      const cv::Mat light = light_behind(raw, *Mosaic::from_name(name));
      const cv::Rect inside(4, 4, image.cols - 8, image.rows - 8);
      // 1 - .884 of the amplitude; of means of two samples 1 - .707, .117.
      EXPECT_LT(cv::norm(light(inside), image(inside), cv::NORM_INF), 0.05) << name;
    }
  }
}

/// Where a picture has no place three pixels away, its mirrored places see the same colour.
TEST(Mosaic, SmallPicturesKeepColoursApart) {
  const cv::Scalar color(0.2, 0.5, 0.8);
  for (const cv::Size size : {cv::Size(2, 2), cv::Size(3, 2), cv::Size(2, 5), cv::Size(3, 3)}) {
    for (const char* name : {"RGGB", "BGGR", "GRBG", "GBRG"}) {
      const cv::Mat image(size, CV_32FC3, color);
      const Mosaic mosaic = *Mosaic::from_name(name);
      EXPECT_LT(cv::norm(light_behind(sampled(image, mosaic), mosaic), image, cv::NORM_INF), 1e-6)
          << name << " " << size;
    }
  }
}

}  // namespace
}  // namespace pencilscan
