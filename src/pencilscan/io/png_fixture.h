#pragma once

// PNG files for tests, of any filter.

#include <libdeflate.h>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace pencilscan::sample {

inline std::string big_endian(std::uint32_t value) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift & 255U);
  return bytes;
}

inline std::string png_chunk(std::string_view type, std::string_view data) {
  const std::string all = std::string(type) + std::string(data);
  return big_endian(static_cast<std::uint32_t>(data.size())) + all +
         big_endian(libdeflate_crc32(0, all.data(), all.size()));
}

struct PngHeader {
  int width = 1;
  int height = 1;
  int bits = 8;
  int color = 2;  ///< 0 grey, 2 RGB
  int interlace = 0;
};

/// `rows`: filtered, each behind the number of its filter. `extra`: chunks before the pixels.
inline std::string png_file(const PngHeader& header, const std::string& rows,
                            const std::string& extra = {}) {
  std::string head = big_endian(static_cast<std::uint32_t>(header.width)) +
                     big_endian(static_cast<std::uint32_t>(header.height));
  for (const int byte : {header.bits, header.color, 0, 0, header.interlace})
    head += static_cast<char>(byte);
  libdeflate_compressor* compressor = libdeflate_alloc_compressor(1);
  std::string data(libdeflate_zlib_compress_bound(compressor, rows.size()), '\0');
  data.resize(
      libdeflate_zlib_compress(compressor, rows.data(), rows.size(), data.data(), data.size()));
  libdeflate_free_compressor(compressor);
  const std::size_t half = data.size() / 2;  // pixels may come in several chunks
  return "\x89PNG\r\n\x1a\n" + png_chunk("IHDR", head) + extra +
         png_chunk("IDAT", std::string_view(data).substr(0, half)) +
         png_chunk("IDAT", std::string_view(data).substr(half)) + png_chunk("IEND", "");
}

}  // namespace pencilscan::sample
