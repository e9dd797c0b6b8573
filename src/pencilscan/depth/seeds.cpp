#include "pencilscan/depth/seeds.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/core/lanes.h"
#include "pencilscan/geometry/least_squares.h"

namespace pencilscan {
namespace {

constexpr std::size_t kLeastPoints = 4;
constexpr double kSteepest = 3.5;  // depth per length across: an incidence of 74 degrees
constexpr double kScatter = 0.8;   // footprints by which points of one surface leave its plane

/// Curve points around a pixel, in arrays that are padded to whole lanes with points that weigh
/// nothing. Inverse depth counts from that of the nearest point w0, in units of it.
struct Neighbors {
  std::vector<float> x, y;      ///< dx / half
  std::vector<float> distance;  ///< of (x, y)
  std::vector<float> w, sigma;  ///< 1/mm
  std::vector<float> relative, deviation, variance, weight;
  std::size_t count = 0;

  void clear() {
    for (std::vector<float>* values : {&x, &y, &distance, &w, &sigma}) values->clear();
    count = 0;
  }
  void add(const Vec2& place, double of_w, double sigma_w) {
    x.push_back(static_cast<float>(place[0]));
    y.push_back(static_cast<float>(place[1]));
    distance.push_back(static_cast<float>(place.norm()));
    w.push_back(static_cast<float>(of_w));
    sigma.push_back(static_cast<float>(sigma_w));
    ++count;
  }
  /// Counts from the nearest point; returns its inverse depth. `scatter`: of one surface's points.
  double prepare(double scatter) {
    const auto nearest = std::min_element(distance.begin(), distance.end()) - distance.begin();
    const float w0 = w[static_cast<std::size_t>(nearest)];
    const std::size_t padded = (count + kLanes - 1) / kLanes * kLanes;
    for (std::vector<float>* values :
         {&x, &y, &distance, &relative, &deviation, &variance, &weight})
      values->resize(padded, 0.F);
    const float scale = static_cast<float>(scatter) * w0;
    for (std::size_t i = 0; i < padded; ++i) {
      const bool is_point = i < count;
      relative[i] = is_point ? (w[i] - w0) / w0 : 0.F;
      deviation[i] = is_point ? sigma[i] / w0 : 0.F;
      variance[i] = deviation[i] * deviation[i] + 1e-2F * scale * scale;
      weight[i] = is_point ? 1 / (variance[i] * (0.1F + distance[i] * distance[i])) : 0.F;
    }
    return static_cast<double>(w0);
  }
  /// Keeps the points i with keep(i).
  template <typename Keep>
  void keep_if(const Keep& keep) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < count; ++i) {
      if (!keep(i)) continue;
      for (std::vector<float>* values : {&x, &y, &distance, &w, &sigma})
        (*values)[kept] = (*values)[i];
      ++kept;
    }
    for (std::vector<float>* values : {&x, &y, &distance, &w, &sigma}) values->resize(kept);
    count = kept;
  }
};

/// What a round of the robust fit allows: lengths as Neighbors has inverse depth.
struct Tolerance {
  float steep;    ///< of a steep surface's plane over the window's half
  float scatter;  ///< of one surface's points from its plane
  bool is_first;
};

/// Normal equations of a plane through the points: sums of weight, x, y, xx, xy, yy, then those of
/// the right side with 1, x and y.
constexpr int kPlaneSums = 9;
PENCILSCAN_CLONES void sum_plane(const Neighbors& points, const float* plane,
                                 const Tolerance& tolerance, float* sums) {
  Lanes of[kPlaneSums] = {};
  for (std::size_t i = 0; i < points.x.size(); i += kLanes) {
    Lanes x, y, distance, w, deviation, variance, weight;
    load(points.x.data() + i, x);
    load(points.y.data() + i, y);
    load(points.distance.data() + i, distance);
    load(points.relative.data() + i, w);
    load(points.deviation.data() + i, deviation);
    load(points.variance.data() + i, variance);
    load(points.weight.data() + i, weight);
    const Lanes r = w - (plane[0] + plane[1] * x + plane[2] * y);
    const Lanes size = r < 0 ? -r : r;
    // At first a point may be as far off as a steep surface takes it, and no farther.
    const Lanes reach = tolerance.steep * distance;
    const Lanes farthest =
        static_cast<float>(kSteepest) * reach + 4.F * (tolerance.scatter + deviation);
    Lanes wide;
    fill(tolerance.scatter, wide);
    if (tolerance.is_first) wide += reach;
    const Lanes share = wide * wide + 9.F * variance;
    const Lanes inlying = share / (share + r * r);
    weight = size > farthest ? weight - weight : weight * inlying * inlying;
    const Lanes wx = weight * x, wy = weight * y;
    of[0] += weight;
    of[1] += wx;
    of[2] += wy;
    of[3] += wx * x;
    of[4] += wx * y;
    of[5] += wy * y;
    of[6] += weight * w;
    of[7] += wx * w;
    of[8] += wy * w;
  }
  for (int k = 0; k < kPlaneSums; ++k) {
    sums[k] = 0;
    for (int lane = 0; lane < kLanes; ++lane) sums[k] += of[k][lane];
  }
}

/// Plane through `points`, reweighted against outliers; takes those that lie on it out.
std::optional<Quadric> robust_plane(Neighbors& points, double per_half) {
  const double w0 = points.prepare(kScatter);
  // Slopes are pulled to zero weakly: a single curve leaves one of them open.
  const double steep = per_half * w0;
  const double scale = kScatter * w0;
  Tolerance tolerance{static_cast<float>(steep), static_cast<float>(scale), true};
  Vec3 c = Vec3::Zero();
  for (int round = 0; round < 4; ++round) {
    const float plane[3] = {static_cast<float>(c[0]), static_cast<float>(c[1]),
                            static_cast<float>(c[2])};
    float sums[kPlaneSums];
    sum_plane(points, plane, tolerance, sums);
    Mat3 A;
    A << sums[0], sums[1], sums[2], sums[1], sums[3], sums[4], sums[2], sums[4], sums[5];
    const double ridge = 1 / (steep * steep);
    A(1, 1) += ridge;
    A(2, 2) += ridge;
    c = solve_symmetric(A, Vec3(sums[6], sums[7], sums[8]));
    tolerance.is_first = false;
  }
  if (!c.allFinite() || !(1 + c[0] > 0)) return std::nullopt;
  if (std::hypot(c[1], c[2]) > kSteepest * steep) return std::nullopt;
  points.keep_if([&](std::size_t i) {
    const double r =
        static_cast<double>(points.relative[i]) - c.dot(Vec3(1, points.x[i], points.y[i]));
    return std::abs(r) >= 4 * (scale + static_cast<double>(points.deviation[i]));
  });
  Quadric q = Quadric::Zero();
  q.head<3>() = w0 * (c + Vec3(1, 0, 0));
  return q;
}

}  // namespace

CurveSeeds::CurveSeeds(const Camera& camera, int camera_index,
                       std::span<const MeasuredPoint> points) {
  per_px_ = 1 / camera.K(0, 0);
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
  thread_local Neighbors points;
  points.clear();
  double depth = 0;
  for_each_near(pixel, radius_px, [&](const Point& p) {
    points.add((p.pixel - pixel) / half, p.w, p.sigma * p.w * p.w);
    depth += 1 / p.w;
  });
  std::vector<Quadric> planes;
  if (points.count < kLeastPoints) return planes;
  depth /= static_cast<double>(points.count);
  const double per_half = half * per_px_ * depth;
  while (planes.size() < 2 && points.count >= kLeastPoints) {
    const auto q = robust_plane(points, per_half);
    if (!q) break;
    planes.push_back(*q);
  }
  return planes;
}

}  // namespace pencilscan
