// PNG: any bytes, and pixels in any filter behind right checksums, which no fuzzer guesses. Where
// our decoder has an answer, it is OpenCV's.

#include <opencv2/imgcodecs.hpp>

#include "fuzz.h"
#include "pencilscan/io/codec.h"
#include "pencilscan/io/png.h"
#include "pencilscan/io/png_fixture.h"

namespace {

using namespace pencilscan;

void compare(const std::string& file) {
  static_cast<void>(sound_png_shape(file));
  const auto ours = plain_png(file);
  if (!ours) return;
  const cv::Mat theirs = decoded_picture(file, cv::IMREAD_ANYDEPTH | cv::IMREAD_ANYCOLOR);
  if (theirs.type() != ours->type() || theirs.size() != ours->size() ||
      cv::norm(theirs, *ours, cv::NORM_INF) > 0)
    std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text = fuzz::text_of(data, size);
  compare(std::string(text));
  fuzz::Choices choices(text);
  sample::PngHeader header;
  header.width = 1 + static_cast<int>(choices.below(20));
  header.height = 1 + static_cast<int>(choices.below(20));
  header.bits = choices.below(2) == 0 ? 8 : 16;
  header.color = choices.below(2) == 0 ? 0 : 2;
  std::string rows;
  while (choices.any()) rows += static_cast<char>(choices.byte());
  // Rows that are as many as the header says, each behind a filter's number.
  const auto row =
      static_cast<std::size_t>(header.width * (header.color == 2 ? 3 : 1) * header.bits / 8 + 1);
  rows.resize(row * static_cast<std::size_t>(header.height), '\4');
  compare(sample::png_file(header, rows));
  return 0;
}
