#include "pencilscan/depth/seeds.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/geometry/least_squares.h"

namespace pencilscan {
namespace {

constexpr std::size_t kLeastPoints = 4;
constexpr double kSteepest = 3.5;  // depth per length across: an incidence of 74 degrees
constexpr double kScatter = 0.8;   // footprints by which points of one surface leave its plane

struct Offset {
  double x, y;  ///< dx / half
  double w, sigma_w, distance;
  double variance = 0, weight = 0;  ///< of w; its inverse, less with the distance
};

/// Plane through `points`, reweighted against outliers; takes those that lie on it out.
std::optional<Quadric> robust_plane(std::vector<Offset>& points, double per_half) {
  const auto nearest =
      std::min_element(points.begin(), points.end(),
                       [](const Offset& a, const Offset& b) { return a.distance < b.distance; });
  const double w0 = nearest->w;
  // Slopes are pulled to zero weakly: a single curve leaves one of them open.
  const double steep = per_half * w0 * w0;
  Vec3 c(w0, 0, 0);
  const double scale = kScatter * w0 * w0;
  for (Offset& p : points) {
    p.variance = p.sigma_w * p.sigma_w + 1e-2 * scale * scale;
    p.weight = 1 / (p.variance * (0.1 + p.distance * p.distance));
  }
  for (int round = 0; round < 4; ++round) {
    double xx = 0, xy = 0, yy = 0, x = 0, y = 0, n = 0;
    Vec3 b = Vec3::Zero();
    for (const Offset& p : points) {
      const double r = p.w - (c[0] + c[1] * p.x + c[2] * p.y);
      // At first a point may be as far off as a steep surface takes it, and no farther.
      if (std::abs(r) > kSteepest * steep * p.distance + 4 * scale + 4 * p.sigma_w) continue;
      const double wide = round == 0 ? steep * p.distance + scale : scale;
      const double share = wide * wide + 9 * p.variance;
      const double inlying = share / (share + r * r);
      const double weight = p.weight * inlying * inlying;
      const double wx = weight * p.x, wy = weight * p.y;
      n += weight;
      x += wx;
      y += wy;
      xx += wx * p.x;
      xy += wx * p.y;
      yy += wy * p.y;
      b += p.w * Vec3(weight, wx, wy);
    }
    Mat3 A;
    A << n, x, y, x, xx, xy, y, xy, yy;
    const double ridge = 1 / (steep * steep);
    A(1, 1) += ridge;
    A(2, 2) += ridge;
    c = solve_symmetric(A, b);
  }
  if (!c.allFinite() || !(c[0] > 0)) return std::nullopt;
  if (std::hypot(c[1], c[2]) > kSteepest * steep) return std::nullopt;
  std::erase_if(points, [&](const Offset& p) {
    return std::abs(p.w - c.dot(Vec3(1, p.x, p.y))) < 4 * scale + 4 * p.sigma_w;
  });
  Quadric q = Quadric::Zero();
  q.head<3>() = c;
  return q;
}

}  // namespace

CurveSeeds::CurveSeeds(const Camera& camera, int camera_index,
                       std::span<const MeasuredPoint> points) {
  per_px_ = 1 / camera.focal_px();
  columns_ = cell(camera.width) + 1;
  rows_ = cell(camera.height) + 1;
  cells_.resize(static_cast<std::size_t>(columns_ * rows_));
  for (const MeasuredPoint& p : points) {
    if (p.camera != camera_index) continue;
    const double z = (camera.device_from_world * position_of(p)).z();
    const int x = cell(p.u);
    const int y = cell(p.v);
    if (!(z > 0) || x < 0 || y < 0 || x >= columns_ || y >= rows_) continue;
    cells_[static_cast<std::size_t>(y * columns_ + x)].push_back(
        {Vec2(p.u, p.v), 1 / z, static_cast<double>(p.sigma)});
  }
}

std::vector<Quadric> CurveSeeds::planes(const Vec2& pixel, double radius_px, int half) const {
  std::vector<Offset> points;
  double depth = 0;
  for_each_near(pixel, radius_px, [&](const Point& p) {
    const Vec2 d = (p.pixel - pixel) / half;
    points.push_back({d[0], d[1], p.w, p.sigma * p.w * p.w, d.norm()});
    depth += 1 / p.w;
  });
  std::vector<Quadric> planes;
  if (points.size() < kLeastPoints) return planes;
  depth /= static_cast<double>(points.size());
  const double per_half = half * per_px_ * depth;
  while (planes.size() < 2 && points.size() >= kLeastPoints) {
    const auto q = robust_plane(points, per_half);
    if (!q) break;
    planes.push_back(*q);
  }
  return planes;
}

}  // namespace pencilscan
