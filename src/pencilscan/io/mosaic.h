#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <string_view>

namespace pencilscan {

/// Which colour each pixel of a sensor sees: 2x2 filters, repeated (Bayer 1976). Two of the four
/// are green, on a diagonal.
class Mosaic {
 public:
  /// "RGGB", "BGGR", "GRBG" or "GBRG": the filters of the pixels (0, 0), (1, 0), (0, 1), (1, 1);
  /// nothing for another name.
  [[nodiscard]] static std::optional<Mosaic> from_name(std::string_view name);
  [[nodiscard]] std::string name() const;

  /// Colour that a pixel sees: 0 red, 1 green, 2 blue.
  [[nodiscard]] int color(int x, int y) const {
    return colors_[static_cast<std::size_t>((y & 1) * 2 + (x & 1))];
  }
  friend bool operator==(const Mosaic&, const Mosaic&) = default;

 private:
  std::array<int, 4> colors_{0, 1, 1, 2};
};

/// What a sensor with this mosaic keeps of an image: RGB of any depth to one channel of it.
[[nodiscard]] cv::Mat sampled(const cv::Mat& rgb, const Mosaic& mosaic);

/// All three colours of every pixel, each colour from its own samples: CV_32FC1 to CV_32FC3 RGB.
/// Samples stay as they are; between them, a colour is the mean of its two or four nearest samples.
/// Lines of light have colours of their own, so one colour does not tell how another one runs, as
/// it would in a photograph.
[[nodiscard]] cv::Mat demosaiced(const cv::Mat& raw, const Mosaic& mosaic);

}  // namespace pencilscan
