#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "pencilscan/detection/detect.h"

namespace pencilscan {

/// Where one camera sees light of any projector, in coarse cells.
struct LitCells {
  cv::Size2f cell_px;
  cv::Mat is_lit;  ///< CV_8UC1, 1: this cell or one beside it is lit; empty: nothing is known

  [[nodiscard]] bool is_dark(const Vec2& pixel) const;
};

/// Cells of two line spacings, since lines lie farther apart only where a surface turns away from
/// its camera or projector. One is lit where the mean presence of a family exceeds that of
/// the picture's darkest tenth by a fiftieth of what the family's lines have: lines cover a third
/// of what they light, so that a surface is dark from 87 degrees on. Without curves nothing is
/// known.
[[nodiscard]] LitCells lit_cells(const Rig& rig, int camera, std::span<const Curve> curves,
                                 std::span<const cv::Mat> presence);

}  // namespace pencilscan
