#include "pencilscan/api/images.h"

#include "pencilscan/core/error.h"
#include "pencilscan/core/formatted.h"

namespace pencilscan {
namespace {

void check_channels(int channels) {
  if (channels == 1 || channels == 3) return;
  throw InputError("image", "channels", std::to_string(channels), "must be 1, or 3 in RGB order");
}

}  // namespace

ImageView::ImageView(const void* values, std::size_t count, int width, int height, int depth,
                     int channels) {
  check_channels(channels);
  const bool has_size = width > 0 && height > 0;
  if (!has_size || count != static_cast<std::size_t>(width) * static_cast<std::size_t>(height) *
                                static_cast<std::size_t>(channels)) {
    throw InputError("image", "values", std::to_string(count),
                     "must be width x height x channels = " + size_text(width, height) + " x " +
                         std::to_string(channels));
  }
  // Nobody writes to the pixels of an input: cv::Mat has no way to say so.
  stored_ = cv::Mat(height, width, CV_MAKETYPE(depth, channels), const_cast<void*>(values));
}

ImageView::ImageView(std::span<const std::uint8_t> values, int width, int height, int channels)
    : ImageView(values.data(), values.size(), width, height, CV_8U, channels) {}
ImageView::ImageView(std::span<const std::uint16_t> values, int width, int height, int channels)
    : ImageView(values.data(), values.size(), width, height, CV_16U, channels) {}
ImageView::ImageView(std::span<const float> values, int width, int height, int channels)
    : ImageView(values.data(), values.size(), width, height, CV_32F, channels) {}

ImageView::ImageView(const cv::Mat& image) : stored_(image) {
  check_channels(image.channels());
  if (image.dims != 2 || image.empty())
    throw InputError("image", "size", "", "must have rows and columns");
  const int depth = image.depth();
  if (depth != CV_8U && depth != CV_16U && depth != CV_32F)
    throw InputError("image", "type", "", "must be 8-bit or 16-bit unsigned, or 32-bit float");
}

}  // namespace pencilscan
