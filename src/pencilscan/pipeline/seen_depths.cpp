#include "pencilscan/pipeline/seen_depths.h"

#include <algorithm>
#include <cmath>

namespace pencilscan {

SeenDepths::SeenDepths(const Camera& camera, int cell_px)
    : cell_px_(cell_px),
      columns_(camera.width / cell_px + 1),
      rows_(camera.height / cell_px + 1),
      cells_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_)) {}

void SeenDepths::add(const Vec2& pixel, double depth) {
  const std::optional<std::size_t> at = cell(pixel);
  if (!at) return;
  Range& range = cells_[*at];
  range = {std::min(range.nearest, depth), std::max(range.farthest, depth)};
}

const SeenDepths::Range* SeenDepths::at(const Vec2& pixel) const {
  const std::optional<std::size_t> at = cell(pixel);
  return at && cells_[*at].nearest <= cells_[*at].farthest ? &cells_[*at] : nullptr;
}

std::optional<std::size_t> SeenDepths::cell(const Vec2& pixel) const {
  constexpr double kFirst = -0.5;  // where the picture begins: centres of pixels are whole numbers
  if (!(pixel.x() >= kFirst && pixel.y() >= kFirst)) return std::nullopt;
  const double column = std::floor(std::max(0.0, pixel.x()) / cell_px_);
  const double row = std::floor(std::max(0.0, pixel.y()) / cell_px_);
  if (column >= columns_ || row >= rows_) return std::nullopt;
  return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
         static_cast<std::size_t>(column);
}

Vec3 about_facing(const Rig& rig, const MeasuredPoint& p) {
  const Vec3 x = position_of(p);
  const Vec3 middle = (rig.cameras[p.camera].center() - x).normalized() +
                      (rig.projectors[p.projector].center() - x).normalized();
  return middle.normalized();
}

}  // namespace pencilscan
