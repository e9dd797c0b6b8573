#include "pencilscan/depth/seeds.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "pencilscan/core/lanes.h"
#include "pencilscan/geometry/least_squares.h"

namespace pencilscan {
namespace {

constexpr std::size_t kLeastPoints = 4;
constexpr std::size_t kMostPlanes = 2;
constexpr double kSteepest = 3.5;  // depth per length across: an incidence of 74 degrees
constexpr double kScatter = 0.8;   // footprints by which points of one surface leave its plane

/// Points around a pixel, in columns of their values.
class Offsets {
 public:
  enum Column : std::size_t {
    kX,  // dx / half
    kY,
    kW,
    kSigma,      // of w
    kDistance,   // hypot(x, y)
    kVariance,   // of w, with the scatter of a surface
    kCertainty,  // its inverse, less with the distance
    kFarthest,   // off the first plane, to count at all
    kShare,      // squared distance from a plane with half the weight of a point in it
    kResidual,
    kSums,  // of a round: addends of kSumCount sums
  };
  enum Sum : std::size_t { kN, kSumX, kSumY, kXX, kXY, kYY, kB0, kB1, kB2 };
  static constexpr std::size_t kSumCount = 9;

  /// Begins anew, with room for so many.
  void clear(std::size_t most) {
    room_ = most;
    count_ = 0;
    const std::size_t size = (kSums + kSumCount) * room_;
    if (values_.size() < size) values_.resize(size);
  }
  void add(double x, double y, double w, double sigma_w) {
    column(kX)[count_] = x;
    column(kY)[count_] = y;
    column(kW)[count_] = w;
    column(kSigma)[count_] = sigma_w;
    ++count_;
  }
  /// Keeps those of which keep(i) holds, in their order.
  template <class Keep>
  void keep_if(Keep&& keep) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      if (!keep(i)) continue;
      for (std::size_t k = kX; k <= kDistance; ++k)
        values_[k * room_ + kept] = values_[k * room_ + i];
      ++kept;
    }
    count_ = kept;
  }
  [[nodiscard]] std::size_t size() const { return count_; }
  [[nodiscard]] std::size_t room() const { return room_; }
  [[nodiscard]] double* column(std::size_t k) { return values_.data() + k * room_; }

 private:
  std::vector<double> values_;
  std::size_t room_ = 0, count_ = 0;
};

PENCILSCAN_CLONES void set_distances(std::size_t count, const double* x, const double* y,
                                     double* distance) {
  for (std::size_t i = 0; i < count; ++i) distance[i] = std::sqrt(x[i] * x[i] + y[i] * y[i]);
}

/// Of robust_plane(): depth per half a window across, and what points of one surface leave.
struct PlaneScales {
  double steep, scatter;
};

/// What does not change from round to round; shares of the first.
PENCILSCAN_CLONES void begin_rounds(std::size_t count, const PlaneScales& of, const double* sigma_w,
                                    const double* distance, double* variance, double* certainty,
                                    double* farthest, double* share) {
  for (std::size_t i = 0; i < count; ++i) {
    variance[i] = sigma_w[i] * sigma_w[i] + 1e-2 * of.scatter * of.scatter;
    certainty[i] = 1 / (variance[i] * (0.1 + distance[i] * distance[i]));
    // At first a point may be as far off as a steep surface takes it, and no farther.
    farthest[i] = kSteepest * of.steep * distance[i] + 4 * of.scatter + 4 * sigma_w[i];
    const double wide = of.steep * distance[i] + of.scatter;
    share[i] = wide * wide + 9 * variance[i];
  }
}

PENCILSCAN_CLONES void narrow(std::size_t count, double scatter, const double* variance,
                              double* share) {
  for (std::size_t i = 0; i < count; ++i) share[i] = scatter * scatter + 9 * variance[i];
}

PENCILSCAN_CLONES void set_residuals(std::size_t count, const double* plane, const double* x,
                                     const double* y, const double* w, double* residual) {
  for (std::size_t i = 0; i < count; ++i)
    residual[i] = w[i] - (plane[0] + plane[1] * x[i] + plane[2] * y[i]);
}

/// `columns`: from kX on, `room` values each.
PENCILSCAN_CLONES void set_addends(std::size_t count, std::size_t room, double* columns) {
  const auto column = [&](std::size_t k) { return columns + k * room; };
  const double *x = column(Offsets::kX), *y = column(Offsets::kY), *w = column(Offsets::kW);
  const double *certainty = column(Offsets::kCertainty), *farthest = column(Offsets::kFarthest);
  const double *share = column(Offsets::kShare), *residual = column(Offsets::kResidual);
  double* sums = column(Offsets::kSums);
#pragma GCC ivdep
  for (std::size_t i = 0; i < count; ++i) {
    const double r = residual[i];
    const double inlying = share[i] / (share[i] + r * r);
    const double lying = certainty[i] * inlying * inlying;
    const double weight = std::abs(r) > farthest[i] ? 0.0 : lying;
    const double wx = weight * x[i], wy = weight * y[i];
    sums[Offsets::kN * room + i] = weight;
    sums[Offsets::kSumX * room + i] = wx;
    sums[Offsets::kSumY * room + i] = wy;
    sums[Offsets::kXX * room + i] = wx * x[i];
    sums[Offsets::kXY * room + i] = wx * y[i];
    sums[Offsets::kYY * room + i] = wy * y[i];
    sums[Offsets::kB0 * room + i] = w[i] * weight;
    sums[Offsets::kB1 * room + i] = w[i] * wx;
    sums[Offsets::kB2 * room + i] = w[i] * wy;
  }
}

/// Plane through `points`, reweighted against outliers; takes those that lie on it out, if another
/// is sought.
std::optional<Quadric> robust_plane(Offsets& points, double per_half, bool takes_out) {
  const std::size_t count = points.size();
  const double* distance = points.column(Offsets::kDistance);
  const double* w = points.column(Offsets::kW);
  const double w0 = w[std::min_element(distance, distance + count) - distance];
  // Slopes are pulled to zero weakly: a single curve leaves one of them open.
  const double steep = per_half * w0 * w0;
  Vec3 c(w0, 0, 0);
  const double scale = kScatter * w0 * w0;
  const double* sigma_w = points.column(Offsets::kSigma);
  const double* variance = points.column(Offsets::kVariance);
  double* residual = points.column(Offsets::kResidual);
  const auto leave_residuals = [&] {
    set_residuals(count, c.data(), points.column(Offsets::kX), points.column(Offsets::kY), w,
                  residual);
  };
  begin_rounds(count, {steep, scale}, sigma_w, distance, points.column(Offsets::kVariance),
               points.column(Offsets::kCertainty), points.column(Offsets::kFarthest),
               points.column(Offsets::kShare));
  for (int round = 0; round < 4; ++round) {
    if (round == 1) narrow(count, scale, variance, points.column(Offsets::kShare));
    leave_residuals();
    set_addends(count, points.room(), points.column(Offsets::kX));
    // Each in the order of the points, all at once.
    std::array<double, Offsets::kSumCount> sums{};
    const double* addends = points.column(Offsets::kSums);
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t k = 0; k < sums.size(); ++k) sums[k] += addends[k * points.room() + i];
    }
    Mat3 A;
    A << sums[Offsets::kN], sums[Offsets::kSumX], sums[Offsets::kSumY], sums[Offsets::kSumX],
        sums[Offsets::kXX], sums[Offsets::kXY], sums[Offsets::kSumY], sums[Offsets::kXY],
        sums[Offsets::kYY];
    const double ridge = 1 / (steep * steep);
    A(1, 1) += ridge;
    A(2, 2) += ridge;
    c = solve_symmetric(A, Vec3(sums[Offsets::kB0], sums[Offsets::kB1], sums[Offsets::kB2]));
  }
  if (!c.allFinite() || !(c[0] > 0)) return std::nullopt;
  if (std::hypot(c[1], c[2]) > kSteepest * steep) return std::nullopt;
  if (takes_out) {
    leave_residuals();
    points.keep_if(
        [&](std::size_t i) { return !(std::abs(residual[i]) < 4 * scale + 4 * sigma_w[i]); });
  }
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
    const double w = 1 / z;
    cells_[static_cast<std::size_t>(y * columns_ + x)].push_back(
        {Vec2(p.u, p.v), w, static_cast<double>(p.sigma) * w * w, 1 / w});
  }
}

std::vector<Quadric> CurveSeeds::planes(const Vec2& pixel, double radius_px, int half) const {
  std::size_t most = 0;
  for_cells_near(pixel, radius_px, [&](const std::vector<Point>& cell) { most += cell.size(); });
  std::vector<Quadric> planes;
  if (most < kLeastPoints) return planes;
  thread_local Offsets points;
  points.clear(most);
  double depth = 0;
  for_each_near(pixel, radius_px, [&](const Point& p) {
    const Vec2 d = (p.pixel - pixel) / half;
    points.add(d[0], d[1], p.w, p.sigma_w);
    depth += p.depth;
  });
  if (points.size() < kLeastPoints) return planes;
  set_distances(points.size(), points.column(Offsets::kX), points.column(Offsets::kY),
                points.column(Offsets::kDistance));
  depth /= static_cast<double>(points.size());
  const double per_half = half * per_px_ * depth;
  while (planes.size() < kMostPlanes && points.size() >= kLeastPoints) {
    const auto q = robust_plane(points, per_half, planes.size() + 1 < kMostPlanes);
    if (!q) break;
    planes.push_back(*q);
  }
  return planes;
}

}  // namespace pencilscan
