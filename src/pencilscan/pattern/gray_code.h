#pragma once

#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/geometry/light_sheet.h"

namespace pencilscan {

/// Reflected binary code: neighbours differ in one bit. Gray, US patent 2,632,058 (1953).
[[nodiscard]] constexpr std::uint32_t gray_from_index(std::uint32_t index) {
  return index ^ (index >> 1U);
}
[[nodiscard]] constexpr std::uint32_t index_from_gray(std::uint32_t gray) {
  for (std::uint32_t shift = 1; shift < 32; shift *= 2) gray ^= gray >> shift;
  return gray;
}

/// ceil(log2(size)): the bits that tell `size` panel columns (or rows) apart; size >= 1.
[[nodiscard]] int gray_code_bits(int size);

/// One image of a Gray-code sequence.
struct GrayCodeImage {
  enum class Kind { kWhite, kBlack, kBit };
  Kind kind = Kind::kBit;
  Axis axis = Axis::kColumn;  ///< kBit: which panel coordinate is coded
  int bit = 0;                ///< kBit: 0 = least significant
  bool inverse = false;       ///< kBit: bright where the bit is 0

  /// Bright at this panel column (kColumn) or row (kRow), an index in [0, size).
  [[nodiscard]] bool bright(int index) const;
};

/// White, black, then each column bit from the most to the least significant, then each row bit; a
/// bit is followed by its inverse when `with_inverses`. The position in the list is the file
/// number.
[[nodiscard]] std::vector<GrayCodeImage> gray_code_sequence(int width, int height,
                                                            bool with_inverses = true);

/// Name of the file at this position of a sequence, without its ending: "007".
[[nodiscard]] std::string gray_code_file_stem(std::size_t position);

/// What the projector shows for one image: CV_8UC1, 0 or 255.
[[nodiscard]] cv::Mat render_gray_code(const GrayCodeImage& image, int width, int height);

/// Panel column and row from one pixel's bits, `bright[i]` for image i of the sequence (white and
/// black are not looked at, inverses neither). The result may lie outside the panel.
struct GrayCodeIndex {
  int column = 0;
  int row = 0;
};
[[nodiscard]] GrayCodeIndex decode_gray_code(std::span<const GrayCodeImage> sequence,
                                             std::span<const std::uint8_t> bright);

}  // namespace pencilscan
