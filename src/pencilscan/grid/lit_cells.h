#pragma once

#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "pencilscan/detection/detect.h"

namespace pencilscan {

/// What a camera sees at and around a place.
enum class Sight : std::uint8_t {
  kDark,   ///< no light of any projector
  kFaint,  ///< little light, and no line
  kLit,    ///< lines, or light enough for lines that are too close to be found
};
inline constexpr std::size_t kSights = 3;

/// What one camera sees of any projector, in coarse cells.
struct LitCells {
  cv::Size2f cell_px;
  cv::Mat seen;  ///< CV_8UC1, the best Sight of a cell and those beside it; empty: nothing is known

  [[nodiscard]] Sight at(const Vec2& pixel) const;
};

/// Cells of two line spacings, since lines lie farther apart only where a surface turns away from
/// its camera or projector. A cell's light is the mean presence of a family above that of the
/// picture's darkest tenth, over what the family's lines have; lines cover a third of what they
/// light. Below a fiftieth it is dark: a surface lit at 87 degrees. Below a tenth (73 degrees:
/// lines lie three times as close) lines would be found, and where none is found it is faint: light
/// that scatters in the scene or in a lens. Without curves nothing is known.
[[nodiscard]] LitCells lit_cells(const Rig& rig, int camera, std::span<const Curve> curves,
                                 std::span<const cv::Mat> presence);

}  // namespace pencilscan
