#pragma once

#include <cstddef>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

namespace pencilscan {

/// How a camera lays out the bytes of a picture.
struct PixelLayout {
  int bits = 8;      ///< of a value: 8, 10, 12, 14 or 16, each in one or two bytes (little endian)
  int channels = 1;  ///< 1 or 3
  bool bgr = false;  ///< of three channels, blue first
  std::string mosaic;  ///< "RGGB" and so on; empty: none

  [[nodiscard]] std::size_t bytes_per_pixel() const {
    return static_cast<std::size_t>(channels) * (bits > 8 ? 2 : 1);
  }
};

/// Of a name in GenICam's pixel format naming convention: Mono8, Mono12, BayerRG8, BayerGB16, RGB8,
/// BGR8 ...; nothing for packed, compressed and other formats.
[[nodiscard]] std::optional<PixelLayout> layout_from_genicam(const std::string& name);

/// The picture of these bytes, 8U or 16U (values spread to the full range), in RGB order. Empty
/// when the bytes are too few. `stride`: bytes from row to row; 0: rows follow each other.
[[nodiscard]] cv::Mat picture_from_bytes(const void* bytes, std::size_t count, int width,
                                         int height, const PixelLayout& layout,
                                         std::size_t stride = 0);

}  // namespace pencilscan
