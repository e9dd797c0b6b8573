#include "pencilscan/grid/crossings.h"

#include <algorithm>
#include <cmath>

namespace pencilscan {
namespace {

using Eigen::Vector2f;

struct Segment {
  int curve = 0;
  int index = 0;
};

constexpr int kCell = 4;

float cross(const Vector2f& a, const Vector2f& b) { return a.x() * b.y() - a.y() * b.x(); }

/// Buckets of curve segments by the cells that their end points touch.
class SegmentGrid {
 public:
  SegmentGrid(std::span<const Curve> curves, cv::Size size)
      : columns_(size.width / kCell + 2), rows_(size.height / kCell + 2) {
    cells_.resize(static_cast<std::size_t>(columns_ * rows_));
    for (std::size_t c = 0; c < curves.size(); ++c) {
      const auto& points = curves[c].points;
      for (std::size_t i = 0; i + 1 < points.size(); ++i) {
        const int first = cell_of(points[i].position);
        const int second = cell_of(points[i + 1].position);
        const Segment segment{static_cast<int>(c), static_cast<int>(i)};
        cells_[static_cast<std::size_t>(first)].push_back(segment);
        if (second != first) cells_[static_cast<std::size_t>(second)].push_back(segment);
      }
    }
  }

  template <class Visit>
  void around(const Vector2f& p, Visit visit) const {
    const int cell = cell_of(p);
    const int cx = cell % columns_;
    const int cy = cell / columns_;
    for (int y = std::max(0, cy - 1); y <= std::min(rows_ - 1, cy + 1); ++y) {
      for (int x = std::max(0, cx - 1); x <= std::min(columns_ - 1, cx + 1); ++x) {
        for (const Segment& s : cells_[static_cast<std::size_t>(y * columns_ + x)]) visit(s);
      }
    }
  }

 private:
  [[nodiscard]] int cell_of(const Vector2f& p) const {
    const int x = std::clamp(static_cast<int>(p.x()) / kCell, 0, columns_ - 1);
    const int y = std::clamp(static_cast<int>(p.y()) / kCell, 0, rows_ - 1);
    return y * columns_ + x;
  }

  int columns_;
  int rows_;
  std::vector<std::vector<Segment>> cells_;
};

/// Mean direction of a curve around a segment: three points to either side.
Vector2f local_tangent(const Curve& curve, int segment) {
  const int n = static_cast<int>(curve.points.size());
  const int low = std::max(0, segment - 2);
  const int high = std::min(n - 1, segment + 3);
  return (curve.points[static_cast<std::size_t>(high)].position -
          curve.points[static_cast<std::size_t>(low)].position)
      .normalized();
}

}  // namespace

std::vector<Crossing> find_crossings(std::span<const Curve> curves, cv::Size image_size,
                                     double min_angle_rad) {
  const SegmentGrid grid(curves, image_size);
  const auto min_sine = static_cast<float>(std::sin(min_angle_rad));
  std::vector<Crossing> crossings;
  std::vector<Segment> seen;
  for (std::size_t a = 0; a < curves.size(); ++a) {
    const auto& points = curves[a].points;
    for (std::size_t i = 0; i + 1 < points.size(); ++i) {
      const Vector2f p = points[i].position;
      const Vector2f r = points[i + 1].position - p;
      seen.clear();
      grid.around(p, [&](const Segment& s) {
        if (s.curve <= static_cast<int>(a)) return;
        const Curve& other = curves[static_cast<std::size_t>(s.curve)];
        const auto j = static_cast<std::size_t>(s.index);
        const Vector2f q = other.points[j].position;
        const Vector2f v = other.points[j + 1].position - q;
        const float denominator = cross(r, v);
        if (denominator == 0) return;
        const float t = cross(q - p, v) / denominator;
        const float u = cross(q - p, r) / denominator;
        if (t < 0 || t >= 1 || u < 0 || u >= 1) return;
        const Vector2f ta = local_tangent(curves[a], static_cast<int>(i));
        const Vector2f tb = local_tangent(other, s.index);
        const float sine = std::abs(cross(ta, tb));
        if (sine < min_sine) return;
        for (const Segment& known : seen) {
          if (known.curve == s.curve && known.index == s.index) return;  // in two cells
        }
        seen.push_back(s);
        const float sigma_a = points[i].sigma_px;
        const float sigma_b = other.points[j].sigma_px;
        crossings.push_back({static_cast<int>(a), s.curve, static_cast<float>(i) + t,
                             static_cast<float>(s.index) + u, p + t * r,
                             std::hypot(sigma_a, sigma_b) / sine / std::sqrt(2.F)});
      });
    }
  }
  std::sort(crossings.begin(), crossings.end(), [](const Crossing& x, const Crossing& y) {
    return std::tie(x.curve_a, x.at_a, x.curve_b) < std::tie(y.curve_a, y.at_a, y.curve_b);
  });
  return crossings;
}

}  // namespace pencilscan
