#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace pencilscan {

/// A colour as shown: 8-bit sRGB in RGB order.
using Color = cv::Vec3b;

[[nodiscard]] inline cv::Scalar scalar(const Color& c) {
  return {double(c[0]), double(c[1]), double(c[2])};
}

/// Pictures are drawn at sixteenths of a pixel (OpenCV's `shift`).
inline constexpr int kSubpixelBits = 4;

inline const Color kUndecidedColor{128, 128, 128};

/// Eight colours that stay apart on a dark ground, for local IDs and for projectors; key modulo 8.
/// A negative key (undecided) is grey.
[[nodiscard]] Color categorical_color(int key);

/// Perceptually even map from dark violet (0) over green to yellow (1); clamped.
[[nodiscard]] Color sequential_color(double value);

/// One entry of a legend.
struct LegendEntry {
  Color color;
  std::string label;
};

/// A dark strip `width_px` wide with coloured squares and labels in as many rows as needed. CV_8UC3
/// RGB.
[[nodiscard]] cv::Mat legend_strip(const std::vector<LegendEntry>& entries, int width_px);

/// A light strip with the sequential map from 0 to high_mm, ticks and a title. CV_8UC3 RGB.
[[nodiscard]] cv::Mat color_bar(const std::string& title, double high_mm, int width_px);

/// Text in the one font of all pictures, its left baseline at (x, y).
void draw_text(cv::Mat& image, const std::string& text, cv::Point at, const Color& color,
               double size = 0.45);

}  // namespace pencilscan
