#include "pencilscan/paper/reprojection.h"

#include <algorithm>
#include <cmath>

namespace pencilscan {

CurveIndex::CurveIndex(const GridGraph& graph, cv::Size image_size)
    : columns_(image_size.width / kCell + 1), rows_(image_size.height / kCell + 1) {
  cells_.resize(static_cast<std::size_t>(columns_ * rows_));
  constexpr std::size_t kStride = 2;
  for (std::size_t c = 0; c < graph.curves.size(); ++c) {
    const CurveIdentity& identity = graph.identities[c];
    if (!identity.pattern) continue;
    const auto& points = graph.curves[c].points;
    for (std::size_t i = 0; i < points.size(); i += kStride) {
      const int x = std::clamp(static_cast<int>(points[i].position.x()) / kCell, 0, columns_ - 1);
      const int y = std::clamp(static_cast<int>(points[i].position.y()) / kCell, 0, rows_ - 1);
      cells_[static_cast<std::size_t>(y * columns_ + x)].push_back(
          {points[i].position, points[i].normal, *identity.pattern, identity.local_id});
    }
  }
}

std::optional<double> CurveIndex::distance(const Vec2& pixel, PatternRef pattern, int local_id,
                                           double radius_px) const {
  const Eigen::Vector2f p = pixel.cast<float>();
  const auto r = static_cast<float>(radius_px);
  const auto cell = [](float v, int count) {
    return std::clamp(static_cast<int>(std::floor(v / kCell)), 0, count - 1);
  };
  constexpr float kReach = 2;  // half the spacing of entries, and a little
  float best = r;
  bool found = false;
  for (int y = cell(p.y() - r, rows_); y <= cell(p.y() + r, rows_); ++y) {
    for (int x = cell(p.x() - r, columns_); x <= cell(p.x() + r, columns_); ++x) {
      for (const Entry& e : cells_[static_cast<std::size_t>(y * columns_ + x)]) {
        if (e.local_id != local_id || !(e.pattern == pattern)) continue;
        const Eigen::Vector2f way = p - e.position;
        const float across = std::abs(way.dot(e.normal));
        const float along = std::abs(way.x() * e.normal.y() - way.y() * e.normal.x());
        const float d = along <= kReach ? across : std::hypot(across, along - kReach);
        if (d < best) {
          best = d;
          found = true;
        }
      }
    }
  }
  if (!found) return std::nullopt;
  return best;
}

}  // namespace pencilscan
