#include "pencilscan/io/mosaic.h"

#include <algorithm>
#include <cstdint>
#include <cstring>

#include "pencilscan/core/check.h"
#include "pencilscan/core/parallel.h"

namespace pencilscan {
namespace {

constexpr std::string_view kLetters = "RGB";

/// The place `i` of a row or column of `size`, mirrored at its ends: a mirrored place sees the same
/// colour.
int inside(int i, int size) {
  if (i < 0) i = -i;
  if (i >= size) i = 2 * (size - 1) - i;
  return std::clamp(i, 0, size - 1);
}

}  // namespace

std::optional<Mosaic> Mosaic::from_name(std::string_view name) {
  if (name != "RGGB" && name != "BGGR" && name != "GRBG" && name != "GBRG") return std::nullopt;
  Mosaic mosaic;
  for (std::size_t i = 0; i < 4; ++i) mosaic.colors_[i] = static_cast<int>(kLetters.find(name[i]));
  return mosaic;
}

std::string Mosaic::name() const {
  std::string name;
  for (const int color : colors_) name += kLetters[static_cast<std::size_t>(color)];
  return name;
}

cv::Mat sampled(const cv::Mat& rgb, const Mosaic& mosaic) {
  PENCILSCAN_CHECK(rgb.channels() == 3);
  cv::Mat raw(rgb.size(), rgb.depth());
  const std::size_t bytes = raw.elemSize();
  for (int y = 0; y < raw.rows; ++y) {
    const std::uint8_t* in = rgb.ptr(y);
    std::uint8_t* out = raw.ptr(y);
    for (int x = 0; x < raw.cols; ++x) {
      std::memcpy(out, in + static_cast<std::size_t>(mosaic.color(x, y)) * bytes, bytes);
      in += 3 * bytes;
      out += bytes;
    }
  }
  return raw;
}

cv::Mat demosaiced(const cv::Mat& raw, const Mosaic& mosaic) {
  PENCILSCAN_CHECK(raw.type() == CV_32FC1 && raw.rows >= 2 && raw.cols >= 2);
  cv::Mat rgb(raw.size(), CV_32FC3);
  parallel_for(static_cast<std::size_t>(raw.rows), [&](std::size_t row) {
    const int y = static_cast<int>(row);
    const float* here = raw.ptr<float>(y);
    const float* above = raw.ptr<float>(inside(y - 1, raw.rows));
    const float* below = raw.ptr<float>(inside(y + 1, raw.rows));
    auto* out = rgb.ptr<cv::Vec3f>(y);
    for (int x = 0; x < raw.cols; ++x) {
      const int left = inside(x - 1, raw.cols);
      const int right = inside(x + 1, raw.cols);
      const int own = mosaic.color(x, y);
      const int beside = mosaic.color(x + 1, y);
      const float across = (here[left] + here[right]) / 2;
      const float down = (above[x] + below[x]) / 2;
      if (own == 1) {  // green: one colour beside it, the other one above and below
        out[x][1] = here[x];
        out[x][beside] = across;
        out[x][2 - beside] = down;
      } else {
        out[x][own] = here[x];
        out[x][1] = (across + down) / 2;
        out[x][2 - own] = (above[left] + above[right] + below[left] + below[right]) / 4;
      }
    }
  });
  return rgb;
}

}  // namespace pencilscan
