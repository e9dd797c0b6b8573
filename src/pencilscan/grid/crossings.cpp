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

constexpr int kCell = 2;         ///< px
constexpr float kMaxLength = 4;  ///< px; points farther apart have a gap between them

float cross(const Vector2f& a, const Vector2f& b) { return a.x() * b.y() - a.y() * b.x(); }

bool is_gap(const Vector2f& p, const Vector2f& q) {
  return (q - p).squaredNorm() > kMaxLength * kMaxLength;
}

/// Curve segments by the cells that their bounding boxes touch: segments that intersect have a cell
/// in common.
class SegmentGrid {
 public:
  SegmentGrid(std::span<const Curve> curves, cv::Size size)
      : columns_(size.width / kCell + 2),
        rows_(size.height / kCell + 2),
        first_(static_cast<std::size_t>(columns_ * rows_) + 1, 0) {
    for_each_place(curves,
                   [&](int cell, const Segment&) { ++first_[static_cast<std::size_t>(cell) + 1]; });
    for (std::size_t c = 1; c < first_.size(); ++c) first_[c] += first_[c - 1];
    segments_.resize(static_cast<std::size_t>(first_.back()));
    std::vector<int> next(first_.begin(), first_.end() - 1);
    for_each_place(curves, [&](int cell, const Segment& segment) {
      segments_[static_cast<std::size_t>(next[static_cast<std::size_t>(cell)]++)] = segment;
    });
  }

  /// Visits the segments near one from p to q, some more than once.
  template <class Visit>
  void around(const Vector2f& p, const Vector2f& q, Visit visit) const {
    for_each_cell(p, q, [&](int cell) {
      const int end = first_[static_cast<std::size_t>(cell) + 1];
      for (int i = first_[static_cast<std::size_t>(cell)]; i < end; ++i)
        visit(segments_[static_cast<std::size_t>(i)]);
    });
  }

 private:
  [[nodiscard]] static int cell(float v, int count) {
    return std::clamp(static_cast<int>(v) / kCell, 0, count - 1);
  }
  template <class Visit>
  void for_each_cell(const Vector2f& p, const Vector2f& q, Visit visit) const {
    const int right = cell(std::max(p.x(), q.x()), columns_);
    const int bottom = cell(std::max(p.y(), q.y()), rows_);
    for (int y = cell(std::min(p.y(), q.y()), rows_); y <= bottom; ++y) {
      for (int x = cell(std::min(p.x(), q.x()), columns_); x <= right; ++x) visit(y * columns_ + x);
    }
  }
  template <class Visit>
  void for_each_place(std::span<const Curve> curves, Visit visit) const {
    for (std::size_t c = 0; c < curves.size(); ++c) {
      const auto& points = curves[c].points;
      for (std::size_t i = 0; i + 1 < points.size(); ++i) {
        if (is_gap(points[i].position, points[i + 1].position)) continue;
        const Segment segment{static_cast<int>(c), static_cast<int>(i)};
        for_each_cell(points[i].position, points[i + 1].position,
                      [&](int at) { visit(at, segment); });
      }
    }
  }

  int columns_;
  int rows_;
  std::vector<int> first_;  ///< of each cell's segments; cells + 1 entries
  std::vector<Segment> segments_;
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
      if (is_gap(p, points[i + 1].position)) continue;
      seen.clear();
      grid.around(p, points[i + 1].position, [&](const Segment& s) {
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
          if (known.curve == s.curve && known.index == s.index) return;  // in several cells
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
