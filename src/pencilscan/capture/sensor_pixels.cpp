#include "pencilscan/capture/sensor_pixels.h"

#include <array>
#include <cstdint>
#include <cstring>
#include <opencv2/imgproc.hpp>

namespace pencilscan {
namespace {

struct BayerName {
  const char* genicam;
  const char* mosaic;
};
constexpr std::array<BayerName, 4> kBayer{
    {{"BayerRG", "RGGB"}, {"BayerBG", "BGGR"}, {"BayerGR", "GRBG"}, {"BayerGB", "GBRG"}}};

std::optional<int> bits_from_text(const std::string& text) {
  for (const int bits : {8, 10, 12, 14, 16})
    if (text == std::to_string(bits)) return bits;
  return std::nullopt;
}

}  // namespace

std::optional<PixelLayout> layout_from_genicam(const std::string& name) {
  PixelLayout layout;
  const auto rest_after = [&](const std::string& start) -> std::optional<int> {
    if (!name.starts_with(start)) return std::nullopt;
    return bits_from_text(name.substr(start.size()));
  };
  for (const BayerName& bayer : kBayer) {
    if (const auto bits = rest_after(bayer.genicam)) {
      layout.bits = *bits;
      layout.mosaic = bayer.mosaic;
      return layout;
    }
  }
  if (const auto bits = rest_after("Mono")) {
    layout.bits = *bits;
    return layout;
  }
  for (const bool bgr : {false, true}) {
    if (const auto bits = rest_after(bgr ? "BGR" : "RGB")) {
      layout.bits = *bits;
      layout.channels = 3;
      layout.bgr = bgr;
      return layout;
    }
  }
  return std::nullopt;
}

cv::Mat picture_from_bytes(const void* bytes, std::size_t count, int width, int height,
                           const PixelLayout& layout, std::size_t stride) {
  const std::size_t row = static_cast<std::size_t>(width) * layout.bytes_per_pixel();
  const std::size_t step = stride == 0 ? row : stride;
  const bool wide = layout.bits > 8;
  if (width < 1 || height < 1 || step < row ||
      count < step * static_cast<std::size_t>(height - 1) + row)
    return {};
  cv::Mat picture(height, width, CV_MAKETYPE(wide ? CV_16U : CV_8U, layout.channels));
  for (int y = 0; y < height; ++y)
    std::memcpy(picture.ptr(y),
                static_cast<const std::uint8_t*>(bytes) + static_cast<std::size_t>(y) * step, row);
  if (wide && layout.bits < 16) {
    // Full scale to full scale: the highest bits are repeated below.
    const int up = 16 - layout.bits;
    const int down = layout.bits - up;
    for (int y = 0; y < height; ++y) {
      auto* values = picture.ptr<std::uint16_t>(y);
      for (int i = 0; i < width * layout.channels; ++i) {
        const unsigned value = values[i] & ((1U << static_cast<unsigned>(layout.bits)) - 1U);
        values[i] = static_cast<std::uint16_t>((value << static_cast<unsigned>(up)) |
                                               (value >> static_cast<unsigned>(down)));
      }
    }
  }
  if (layout.bgr) cv::cvtColor(picture, picture, cv::COLOR_BGR2RGB);
  return picture;
}

}  // namespace pencilscan
