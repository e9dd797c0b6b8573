#include "pencilscan/report/palette.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>

namespace pencilscan {
namespace {

const Color kDark{27, 30, 36};
const Color kLightText{225, 228, 233};

int text_width(const std::string& text, double size) {
  int baseline = 0;
  return cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, size, 1, &baseline).width;
}

}  // namespace

Color categorical_color(int key) {
  static const std::array<Color, 8> kColors = {
      Color{72, 140, 255},  Color{255, 159, 28}, Color{46, 196, 182},  Color{255, 77, 94},
      Color{178, 128, 255}, Color{247, 231, 51}, Color{110, 220, 100}, Color{250, 250, 250}};
  if (key < 0) return kUndecidedColor;
  return kColors[static_cast<std::size_t>(key) % kColors.size()];
}

Color sequential_color(double value) {
  static const cv::Mat kTable = [] {
    cv::Mat ramp(1, 256, CV_8U);
    for (int i = 0; i < 256; ++i) ramp.at<uchar>(0, i) = static_cast<uchar>(i);
    cv::Mat colors;
    cv::applyColorMap(ramp, colors, cv::COLORMAP_VIRIDIS);
    cv::cvtColor(colors, colors, cv::COLOR_BGR2RGB);
    return colors;
  }();
  const double clamped = std::isfinite(value) ? std::clamp(value, 0.0, 1.0) : 1.0;
  return kTable.at<Color>(0, static_cast<int>(std::lround(255 * clamped)));
}

void draw_text(cv::Mat& image, const std::string& text, cv::Point at, const Color& color,
               double size) {
  cv::putText(image, text, at, cv::FONT_HERSHEY_SIMPLEX, size, scalar(color), 1, cv::LINE_AA);
}

cv::Mat legend_strip(const std::vector<LegendEntry>& entries, int width_px) {
  constexpr int kRow = 28;
  constexpr int kSquare = 14;
  constexpr int kGap = 20;
  constexpr double kSize = 0.45;
  std::vector<cv::Point> corners;
  int x = kGap / 2;
  int y = 0;
  for (const LegendEntry& entry : entries) {
    const int wide = kSquare + 6 + text_width(entry.label, kSize);
    if (x > kGap / 2 && x + wide > width_px) {
      x = kGap / 2;
      y += kRow;
    }
    corners.emplace_back(x, y + (kRow - kSquare) / 2);
    x += wide + kGap;
  }
  cv::Mat strip(y + kRow, width_px, CV_8UC3, scalar(kDark));
  for (std::size_t i = 0; i < entries.size(); ++i) {
    cv::rectangle(strip, cv::Rect(corners[i], cv::Size(kSquare, kSquare)), scalar(entries[i].color),
                  cv::FILLED);
    draw_text(strip, entries[i].label, corners[i] + cv::Point(kSquare + 6, kSquare - 2), kLightText,
              kSize);
  }
  return strip;
}

cv::Mat color_bar(const std::string& title, double high_mm, int width_px) {
  constexpr int kHeight = 58;
  cv::Mat strip(kHeight, width_px, CV_8UC3, cv::Scalar(250, 250, 251));
  const Color ink{60, 64, 70};
  const int left = std::min(24 + text_width(title, 0.5), width_px / 2);
  const int right = width_px - 60;
  draw_text(strip, title, {12, 27}, ink, 0.5);
  for (int x = left; x < right; ++x) {
    const double value = double(x - left) / std::max(right - left - 1, 1);
    cv::line(strip, {x, 14}, {x, 32}, scalar(sequential_color(value)));
  }
  for (int tick = 0; tick <= 4; ++tick) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), tick == 4 ? ">= %.3g mm" : "%.3g", high_mm * tick / 4);
    const int x = left + (right - left) * tick / 4;
    cv::line(strip, {x, 32}, {x, 36}, scalar(ink));
    const int half = text_width(text.data(), 0.4) / 2;
    draw_text(strip, text.data(), {std::min(x - half, width_px - 2 * half - 4), 50}, ink, 0.4);
  }
  return strip;
}

}  // namespace pencilscan
