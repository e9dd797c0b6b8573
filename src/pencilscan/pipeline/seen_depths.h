#pragma once

#include <limits>
#include <optional>
#include <vector>

#include "pencilscan/labeling/measured_point.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// Depths of points in one camera's picture, by square cells of it. The nearest ones of a cell hide
/// what lies behind them.
class SeenDepths {
 public:
  /// Of the points of one cell, in the rig's unit.
  struct Range {
    double nearest = std::numeric_limits<double>::max();
    double farthest = std::numeric_limits<double>::lowest();
  };

  /// `cell_px`: side of a cell, above 0.
  SeenDepths(const Camera& camera, int cell_px);

  /// Leaves out what is not in the picture.
  void add(const Vec2& pixel, double depth);
  /// Of the cell that a pixel lies in. Null where it has no point, or is not in the picture.
  [[nodiscard]] const Range* at(const Vec2& pixel) const;

 private:
  [[nodiscard]] std::optional<std::size_t> cell(const Vec2& pixel) const;

  int cell_px_;
  int columns_;
  int rows_;
  std::vector<Range> cells_;
};

/// Where the surface faces at a measured point: about the middle of the camera that saw it and the
/// projector that lit it. A unit vector in the world's frame.
[[nodiscard]] Vec3 about_facing(const Rig& rig, const MeasuredPoint& p);

}  // namespace pencilscan
