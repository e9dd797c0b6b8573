#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "pencilscan/geometry/light_sheet.h"
#include "pencilscan/pattern/pattern_color.h"

namespace pencilscan {

/// Parallel lines with a periodic colour code. Values are valid when validated by the rig reader:
/// colors.size() == alphabet >= 1, pitch_px > 0, 0 < line_width_px <= pitch_px, symbols of
/// `sequence` in [0, alphabet).
struct LinePattern {
  Axis axis = Axis::kColumn;  ///< kColumn: vertical lines, kRow: horizontal lines
  std::vector<PatternColor> colors = {"blue", "cyan"};
  int alphabet = 2;
  int order = 3;
  double pitch_px = 12;
  double line_width_px = 4;
  double offset_px = 6;
  std::vector<int> sequence = {0, 0, 0, 1, 0, 1, 1, 1};  ///< one period of symbols
  bool has_own_sequence = false;                         ///< the file states the sequence itself
  std::optional<int> max_lines;                          ///< "lines" of the file

  friend bool operator==(const LinePattern&, const LinePattern&) = default;

  [[nodiscard]] int period() const { return static_cast<int>(sequence.size()); }
  [[nodiscard]] int local_id(int line) const { return line % period(); }
  [[nodiscard]] int symbol(int line) const {
    return sequence[static_cast<std::size_t>(local_id(line))];
  }
  [[nodiscard]] Rgb color(int line) const;
  [[nodiscard]] double position_px(double line) const { return offset_px + line * pitch_px; }
  /// Continuous line coordinate of a projector column or row: line i has its centre at i.
  [[nodiscard]] double coordinate(double px) const { return (px - offset_px) / pitch_px; }
  /// Number of lines on a panel `size_px` wide (high for kRow): centres within [-0.5, size - 0.5].
  [[nodiscard]] int line_count(int size_px) const;
  /// Ideal colour at a continuous projector position, averaged over a box of `box_px` (>= 0).
  [[nodiscard]] Rgb value(double px, int size_px, double box_px) const;
};

/// The line nearest to a continuous coordinate that has this local ID (any if negative), limited to
/// the pattern; -1: the pattern has none.
[[nodiscard]] int nearest_line(double coordinate, int local_id, int period, int line_count);

/// What a projector of this size shows: linear light, CV_32FC3 in RGB order, each pixel the box
/// average of the ideal lines; several patterns add up, limited to 1.
[[nodiscard]] cv::Mat render_patterns(const std::vector<LinePattern>& patterns, int width,
                                      int height);

}  // namespace pencilscan
