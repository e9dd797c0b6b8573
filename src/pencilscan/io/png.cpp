#include "pencilscan/io/png.h"

#include <libdeflate.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

namespace pencilscan {
namespace {

using std::string_view_literals::operator""sv;

constexpr std::string_view kSignature = "\x89PNG\r\n\x1a\n"sv;

std::uint32_t big_endian_32(std::string_view bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t k = 0; k < 4; ++k)
    value = value << 8 | static_cast<unsigned char>(bytes[at + k]);
  return value;
}

/// A chunk: length, type, data, checksum of type and data (section 5).
struct Chunk {
  std::string_view type_and_data;
  std::uint32_t checksum = 0;

  [[nodiscard]] std::string_view type() const { return type_and_data.substr(0, 4); }
  [[nodiscard]] std::string_view data() const { return type_and_data.substr(4); }
  [[nodiscard]] bool is_sound() const {
    return libdeflate_crc32(0, type_and_data.data(), type_and_data.size()) == checksum;
  }
};

/// Walks the chunks to IEND as long as visit(chunk) says true.
template <class Visit>
bool reaches_end(std::string_view bytes, Visit visit) {
  std::size_t at = kSignature.size();
  while (at + 12 <= bytes.size()) {
    const std::size_t length = big_endian_32(bytes, at);
    if (length > bytes.size() - at - 12) return false;
    const Chunk chunk{bytes.substr(at + 4, 4 + length), big_endian_32(bytes, at + 8 + length)};
    if (!visit(chunk)) return false;
    if (chunk.type() == "IEND"sv) return true;
    at += 12 + length;
  }
  return false;
}

/// What IHDR says of pictures of 8 or 16 bits, grey or RGB.
struct PixelLayout {
  int width = 0;
  int height = 0;
  int channels = 0;
  int bytes_per_sample = 0;
  bool is_interlaced = false;

  [[nodiscard]] std::size_t bytes_per_pixel() const {
    return static_cast<std::size_t>(channels * bytes_per_sample);
  }
  [[nodiscard]] std::size_t bytes_per_row() const {
    return static_cast<std::size_t>(width) * bytes_per_pixel();
  }
};

std::optional<PixelLayout> layout_of(std::string_view bytes) {
  constexpr std::size_t kLength = 33;        // signature and IHDR
  constexpr std::uint32_t kMost = 1U << 30;  // pixels, as OpenCV has it
  constexpr char kGrey = 0;
  constexpr char kRgb = 2;
  if (!is_png(bytes) || bytes.size() < kLength || bytes.substr(12, 4) != "IHDR"sv)
    return std::nullopt;
  const std::uint32_t width = big_endian_32(bytes, 16);
  const std::uint32_t height = big_endian_32(bytes, 20);
  const char bits = bytes[24];
  const char color = bytes[25];
  if (width == 0 || height == 0 || width > kMost / height) return std::nullopt;
  if ((bits != 8 && bits != 16) || (color != kGrey && color != kRgb)) return std::nullopt;
  return PixelLayout{static_cast<int>(width), static_cast<int>(height), color == kGrey ? 1 : 3,
                     bits / 8, bytes[28] != 0};
}

/// What IDAT chunks hold together, compressed; nothing where a checksum is wrong or a chunk decides
/// how the pixels are meant.
std::optional<std::string> compressed_data(std::string_view bytes) {
  std::string data;
  const bool is_plain = reaches_end(bytes, [&](const Chunk& chunk) {
    if (!chunk.is_sound()) return false;
    const std::string_view type = chunk.type();
    if (type == "IDAT"sv) {
      data += chunk.data();
      return true;
    }
    const bool is_ancillary = (type[0] & 0x20) != 0;
    return type == "IHDR"sv || type == "IEND"sv || (is_ancillary && type != "tRNS"sv);
  });
  if (!is_plain) return std::nullopt;
  return data;
}

struct FreeDecompressor {
  void operator()(libdeflate_decompressor* d) const { libdeflate_free_decompressor(d); }
};

/// Rows behind the number of their filter each; nothing where there are more or fewer.
std::optional<std::vector<std::uint8_t>> inflated(std::string_view data, std::size_t size) {
  constexpr std::size_t kMostRatio = 1032;  // of deflate: 258 bytes from two bits
  if (data.size() < size / kMostRatio) return std::nullopt;
  const std::unique_ptr<libdeflate_decompressor, FreeDecompressor> decompressor(
      libdeflate_alloc_decompressor());
  if (!decompressor) return std::nullopt;
  std::vector<std::uint8_t> rows(size);
  if (libdeflate_zlib_decompress(decompressor.get(), data.data(), data.size(), rows.data(),
                                 rows.size(), nullptr) != LIBDEFLATE_SUCCESS)
    return std::nullopt;
  return rows;
}

template <std::size_t kBytes>
void add_left(std::uint8_t* row, std::size_t size) {
  for (std::size_t i = kBytes; i < size; ++i)
    row[i] = static_cast<std::uint8_t>(row[i] + row[i - kBytes]);
}

void add_above(const std::uint8_t* above, std::uint8_t* row, std::size_t size) {
  for (std::size_t i = 0; i < size; ++i) row[i] = static_cast<std::uint8_t>(row[i] + above[i]);
}

template <std::size_t kBytes>
void add_mean(const std::uint8_t* above, std::uint8_t* row, std::size_t size) {
  for (std::size_t i = 0; i < size; ++i) {
    const int left = i < kBytes ? 0 : row[i - kBytes];
    row[i] = static_cast<std::uint8_t>(row[i] + (left + above[i]) / 2);
  }
}

/// One of left, above and above left: that which is nearest to left + above - above left (Paeth
/// 1991), of all bytes of a pixel at once.
template <std::size_t kBytes>
void add_nearest(const std::uint8_t* above, std::uint8_t* row, std::size_t size) {
  using Bytes __attribute__((vector_size(16))) = std::int16_t;
  const auto pixel = [](const std::uint8_t* from) {
    Bytes values{};
    for (std::size_t k = 0; k < kBytes; ++k) values[k] = from[k];
    return values;
  };
  const auto magnitude = [](const Bytes& v) { return v > 0 ? v : -v; };
  Bytes left{};
  Bytes corner{};
  for (std::size_t i = 0; i < size; i += kBytes) {
    const Bytes up = pixel(above + i);
    const Bytes without_left = up - corner;  // left + up - corner lies so far from left, ...
    const Bytes without_up = left - corner;
    const Bytes to_corner = magnitude(without_left + without_up);
    const Bytes to_left = magnitude(without_left);
    const Bytes to_up = magnitude(without_up);
    Bytes nearest = to_up < to_left ? up : left;
    nearest = to_corner < (to_up < to_left ? to_up : to_left) ? corner : nearest;
    left = (pixel(row + i) + nearest) & 255;
    for (std::size_t k = 0; k < kBytes; ++k) row[i + k] = static_cast<std::uint8_t>(left[k]);
    corner = up;
  }
}

/// Takes the filters (section 9) of rows of pixels of so many bytes out where they are.
template <std::size_t kBytes>
bool unfilter(std::size_t size, std::vector<std::uint8_t>& rows) {
  const std::vector<std::uint8_t> nothing(size, 0);
  const std::uint8_t* above = nothing.data();
  for (std::size_t at = 0; at < rows.size(); at += size + 1) {
    std::uint8_t* row = rows.data() + at + 1;
    switch (rows[at]) {
      case 0:
        break;
      case 1:
        add_left<kBytes>(row, size);
        break;
      case 2:
        add_above(above, row, size);
        break;
      case 3:
        add_mean<kBytes>(above, row, size);
        break;
      case 4:
        add_nearest<kBytes>(above, row, size);
        break;
      default:
        return false;
    }
    above = row;
  }
  return true;
}

bool unfilter(const PixelLayout& layout, std::vector<std::uint8_t>& rows) {
  switch (layout.bytes_per_pixel()) {
    case 1:
      return unfilter<1>(layout.bytes_per_row(), rows);
    case 2:
      return unfilter<2>(layout.bytes_per_row(), rows);
    case 3:
      return unfilter<3>(layout.bytes_per_row(), rows);
    default:
      return unfilter<6>(layout.bytes_per_row(), rows);
  }
}

}  // namespace

bool is_png(std::string_view bytes) { return bytes.starts_with(kSignature); }

bool png_reaches_end(std::string_view bytes) {
  return reaches_end(bytes, [](const Chunk&) { return true; });
}

std::optional<ImageShape> sound_png_shape(std::string_view bytes) {
  const std::optional<PixelLayout> layout = layout_of(bytes);
  if (!layout || !reaches_end(bytes, [](const Chunk& chunk) { return chunk.is_sound(); }))
    return std::nullopt;
  return ImageShape{layout->width, layout->height, layout->channels};
}

std::optional<cv::Mat> plain_png(std::string_view bytes) {
  const std::optional<PixelLayout> layout = layout_of(bytes);
  if (!layout || layout->is_interlaced) return std::nullopt;
  const std::optional<std::string> data = compressed_data(bytes);
  if (!data) return std::nullopt;
  const std::size_t size = layout->bytes_per_row();
  auto rows = inflated(*data, (size + 1) * static_cast<std::size_t>(layout->height));
  if (!rows || !unfilter(*layout, *rows)) return std::nullopt;
  cv::Mat image(layout->height, layout->width,
                CV_MAKETYPE(layout->bytes_per_sample == 1 ? CV_8U : CV_16U, layout->channels));
  for (int y = 0; y < image.rows; ++y) {
    const std::uint8_t* from = rows->data() + static_cast<std::size_t>(y) * (size + 1) + 1;
    std::uint8_t* to = image.ptr(y);
    std::memcpy(to, from, size);
    if (layout->bytes_per_sample == 1) continue;
    for (std::size_t i = 0; i < size; i += 2) {  // big-endian in the file
      const auto value = static_cast<std::uint16_t>(from[i] << 8 | from[i + 1]);
      std::memcpy(to + i, &value, 2);
    }
  }
  return image;
}

}  // namespace pencilscan
