#include "pencilscan/pattern/gray_code.h"

#include "pencilscan/core/check.h"

namespace pencilscan {

int gray_code_bits(int size) {
  PENCILSCAN_CHECK(size >= 1);
  int bits = 0;
  while ((std::int64_t{1} << bits) < size) ++bits;
  return bits;
}

bool GrayCodeImage::bright(int index) const {
  if (kind != Kind::kBit) return kind == Kind::kWhite;
  const std::uint32_t gray = gray_from_index(static_cast<std::uint32_t>(index));
  return (((gray >> static_cast<unsigned>(bit)) & 1U) != 0) != inverse;
}

std::vector<GrayCodeImage> gray_code_sequence(int width, int height, bool with_inverses) {
  using Kind = GrayCodeImage::Kind;
  std::vector<GrayCodeImage> sequence;
  sequence.push_back({Kind::kWhite, Axis::kColumn, 0, false});
  sequence.push_back({Kind::kBlack, Axis::kColumn, 0, false});
  for (const Axis axis : {Axis::kColumn, Axis::kRow}) {
    for (int bit = gray_code_bits(axis == Axis::kColumn ? width : height) - 1; bit >= 0; --bit) {
      sequence.push_back({Kind::kBit, axis, bit, false});
      if (with_inverses) sequence.push_back({Kind::kBit, axis, bit, true});
    }
  }
  return sequence;
}

std::string gray_code_file_stem(std::size_t position) {
  const std::string digits = std::to_string(position);
  return std::string(digits.size() < 3 ? 3 - digits.size() : 0, '0') + digits;
}

cv::Mat render_gray_code(const GrayCodeImage& image, int width, int height) {
  cv::Mat panel(height, width, CV_8UC1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      panel.at<std::uint8_t>(y, x) = image.bright(image.axis == Axis::kColumn ? x : y) ? 255 : 0;
    }
  }
  return panel;
}

GrayCodeIndex decode_gray_code(std::span<const GrayCodeImage> sequence,
                               std::span<const std::uint8_t> bright) {
  PENCILSCAN_CHECK(sequence.size() == bright.size());
  std::uint32_t column = 0;
  std::uint32_t row = 0;
  for (std::size_t i = 0; i < sequence.size(); ++i) {
    const GrayCodeImage& image = sequence[i];
    if (image.kind != GrayCodeImage::Kind::kBit || image.inverse || bright[i] == 0) continue;
    (image.axis == Axis::kColumn ? column : row) |= 1U << static_cast<unsigned>(image.bit);
  }
  return {static_cast<int>(index_from_gray(column)), static_cast<int>(index_from_gray(row))};
}

}  // namespace pencilscan
