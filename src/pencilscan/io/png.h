#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string_view>

namespace pencilscan {

// Portable Network Graphics, ISO/IEC 15948. `bytes`: of a whole file.

[[nodiscard]] bool is_png(std::string_view bytes);

/// True where the chunks reach to IEND.
[[nodiscard]] bool png_reaches_end(std::string_view bytes);

struct ImageShape {
  int width = 0;
  int height = 0;
  int channels = 0;
};
/// The shape of a PNG of 8 or 16 bits, grey or RGB, whose bytes are those that were written, by the
/// checksums of its chunks. Nothing of any other file.
[[nodiscard]] std::optional<ImageShape> sound_png_shape(std::string_view bytes);

/// The pixels of such a PNG as they are, CV_8U or CV_16U, of one channel or of three in RGB order,
/// in half the time that OpenCV takes (libpng on zlib). Nothing where it is interlaced, transparent
/// or broken: OpenCV may read it.
[[nodiscard]] std::optional<cv::Mat> plain_png(std::string_view bytes);

}  // namespace pencilscan
