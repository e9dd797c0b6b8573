#include "pencilscan/io/triangulated_polygon.h"

#include <algorithm>
#include <numeric>

#include "pencilscan/core/check.h"

namespace pencilscan {
namespace {

/// Twice the area of a triangle of this share of the polygon's own is rounding, not a turn.
constexpr double kFlatShare = 1e-12;

/// Twice the polygon's area along its normal (Newell).
Vec3 doubled_area(std::span<const Vec3> corners) {
  Vec3 sum = Vec3::Zero();
  for (std::size_t k = 2; k < corners.size(); ++k)
    sum += (corners[k - 1] - corners[0]).cross(corners[k] - corners[0]);
  return sum;
}

/// Twice the area of a triangle in the plane, > 0 counter-clockwise.
double turn(const Vec2& a, const Vec2& b, const Vec2& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

/// Cuts ears off a polygon in the plane, which turns counter-clockwise.
class EarCutter {
 public:
  EarCutter(std::vector<Vec2> corners, double flat)
      : corners_(std::move(corners)), flat_(flat), ring_(corners_.size()) {
    std::iota(ring_.begin(), ring_.end(), std::size_t{0});
  }

  std::vector<std::array<std::size_t, 3>> cut() {
    std::vector<std::array<std::size_t, 3>> triangles;
    while (ring_.size() > 3) {
      const std::size_t ear = find_ear();
      if (ear == ring_.size()) break;
      triangles.push_back(around(ear));
      ring_.erase(ring_.begin() + static_cast<std::ptrdiff_t>(ear));
    }
    for (std::size_t k = 2; k < ring_.size(); ++k)
      triangles.push_back({ring_[0], ring_[k - 1], ring_[k]});
    return triangles;
  }

 private:
  [[nodiscard]] std::array<std::size_t, 3> around(std::size_t at) const {
    const std::size_t size = ring_.size();
    return {ring_[(at + size - 1) % size], ring_[at], ring_[(at + 1) % size]};
  }

  [[nodiscard]] bool is_empty(const std::array<std::size_t, 3>& triangle) const {
    const Vec2& a = corners_[triangle[0]];
    const Vec2& b = corners_[triangle[1]];
    const Vec2& c = corners_[triangle[2]];
    return std::none_of(ring_.begin(), ring_.end(), [&](std::size_t other) {
      const Vec2& x = corners_[other];
      if (x == a || x == b || x == c) return false;
      return turn(a, b, x) >= -flat_ && turn(b, c, x) >= -flat_ && turn(c, a, x) >= -flat_;
    });
  }

  /// A corner whose triangle holds no other; where there is none, one on a straight side; the size
  /// of the ring where there is neither.
  [[nodiscard]] std::size_t find_ear() const {
    std::size_t straight = ring_.size();
    for (std::size_t i = 0; i < ring_.size(); ++i) {
      const auto triangle = around(i);
      const double area = turn(corners_[triangle[0]], corners_[triangle[1]], corners_[triangle[2]]);
      if (area > flat_ && is_empty(triangle)) return i;
      if (std::abs(area) <= flat_) straight = i;
    }
    return straight;
  }

  std::vector<Vec2> corners_;
  double flat_;
  std::vector<std::size_t> ring_;
};

}  // namespace

bool is_fan(std::span<const Vec3> corners) {
  const Vec3 whole = doubled_area(corners);
  const double least = -kFlatShare * whole.squaredNorm();
  for (std::size_t k = 2; k < corners.size(); ++k) {
    if (whole.dot((corners[k - 1] - corners[0]).cross(corners[k] - corners[0])) < least)
      return false;
  }
  return true;
}

std::vector<std::array<std::size_t, 3>> triangulated_polygon(std::span<const Vec3> corners) {
  std::vector<std::array<std::size_t, 3>> fan;
  for (std::size_t k = 2; k < corners.size(); ++k) fan.push_back({0, k - 1, k});
  if (is_fan(corners)) return fan;
  PENCILSCAN_CHECK(corners.size() <= kMostConcaveCorners);
  const Vec3 whole = doubled_area(corners);
  const Vec3 normal = whole.normalized();
  const Vec3 right = normal.unitOrthogonal();
  const Vec3 up = normal.cross(right);
  std::vector<Vec2> flat;
  for (const Vec3& x : corners)
    flat.emplace_back(right.dot(x - corners[0]), up.dot(x - corners[0]));
  return EarCutter(std::move(flat), kFlatShare * whole.norm()).cut();
}

}  // namespace pencilscan
