#include "pencilscan/pattern/line_pattern.h"

#include <algorithm>
#include <cmath>

namespace pencilscan {

Rgb LinePattern::color(int line) const {
  return colors[static_cast<std::size_t>(symbol(line))].light();
}

int LinePattern::line_count(int size_px) const {
  const double last = coordinate(size_px - 0.5);
  // Line 0 lies at offset_px; a centre on the border counts.
  int count = std::max(0, static_cast<int>(std::floor(last + 1e-9)) + 1);
  if (max_lines) count = std::min(count, *max_lines);
  return count;
}

Rgb LinePattern::value(double px, int size_px, double box_px) const {
  Rgb sum{0, 0, 0};
  const double reach = 0.5 * (line_width_px + box_px);
  const int first = std::max(0, static_cast<int>(std::ceil(coordinate(px - reach))));
  const int last =
      std::min(line_count(size_px) - 1, static_cast<int>(std::floor(coordinate(px + reach))));
  for (int line = first; line <= last; ++line) {
    const double center = position_px(line);
    double cover = 1;
    if (box_px > 0) {
      const double low = std::max(px - 0.5 * box_px, center - 0.5 * line_width_px);
      const double high = std::min(px + 0.5 * box_px, center + 0.5 * line_width_px);
      cover = std::max(0.0, high - low) / box_px;
    }
    const Rgb rgb = color(line);
    for (std::size_t k = 0; k < 3; ++k) sum[k] = std::min(1.0, sum[k] + cover * rgb[k]);
  }
  return sum;
}

int nearest_line(double coordinate, int local_id, int period, int line_count) {
  if (!std::isfinite(coordinate) || line_count < 1) return -1;
  const double bounded = std::clamp(coordinate, -1e6, 1e6);
  if (local_id < 0 || period < 2) {
    return std::clamp(static_cast<int>(std::lround(bounded)), 0, line_count - 1);
  }
  const int last_cycle = (line_count - 1 - local_id) / period;
  if (local_id >= line_count) return -1;
  const long cycle = std::lround((bounded - local_id) / period);
  return local_id + period * static_cast<int>(std::clamp<long>(cycle, 0, last_cycle));
}

cv::Mat render_patterns(const std::vector<LinePattern>& patterns, int width, int height) {
  cv::Mat image(height, width, CV_32FC3, cv::Scalar::all(0));
  for (const LinePattern& pattern : patterns) {
    const bool columns = pattern.axis == Axis::kColumn;
    const int size = columns ? width : height;
    for (int i = 0; i < size; ++i) {
      const Rgb rgb = pattern.value(i, size, 1);
      const cv::Scalar add(rgb[0], rgb[1], rgb[2]);
      cv::Mat strip = columns ? image.col(i) : image.row(i);
      strip += add;
    }
  }
  return cv::min(image, 1.0);
}

}  // namespace pencilscan
