#include "pencilscan/points/local_surface.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "pencilscan/core/lanes.h"
#include "pencilscan/geometry/quadric_moments.h"
#include "pencilscan/points/pixel_lattice.h"

namespace pencilscan {
namespace {

using Eigen::Vector2f;
using Vector6f = Eigen::Matrix<float, 6, 1>;
using Matrix6f = Eigen::Matrix<float, 6, 6>;

Vector6f terms(const Vector2f& d) {
  Vector6f row;
  row << 1, d.x(), d.y(), d.x() * d.x(), d.x() * d.y(), d.y() * d.y();
  return row;
}

/// Points around a pixel in columns, a multiple of kLanes of them; padding weighs nothing.
struct Columns {
  const float* x;
  const float* y;
  const float* z;
  const float* inverse_sigma;
  const float* near;
  float* deviation;
  std::size_t size;
};

/// The 15 moments sum(w x^a y^b), a + b <= 4, and the 6 of z. Robust weights by the deviations of
/// the last fit, in units of 1 / `inverse_scale`.
struct Moments {
  std::array<float, 15> of_terms;
  std::array<float, 6> of_z;
};

PENCILSCAN_CLONES void sum_moments(const Columns& points, bool by_distance, float inverse_scale,
                                   Moments& sums) {
  Lanes m[15] = {};
  Lanes r[6] = {};
  for (std::size_t i = 0; i < points.size; i += kLanes) {
    Lanes x, y, z, inverse_sigma, near, deviation;
    load(points.x + i, x);
    load(points.y + i, y);
    load(points.z + i, z);
    load(points.inverse_sigma + i, inverse_sigma);
    load(points.near + i, near);
    load(points.deviation + i, deviation);
    const Lanes e = deviation * inverse_scale;
    const Lanes robust = inverse_sigma / (1 + e * e);
    Lanes w = robust * robust;
    if (by_distance) w *= near;
    const Lanes wx = w * x;
    const Lanes wy = w * y;
    const Lanes wxx = wx * x;
    const Lanes wxy = wx * y;
    const Lanes wyy = wy * y;
    const Lanes xx = x * x;
    const Lanes xy = x * y;
    const Lanes yy = y * y;
    m[0] += w;
    m[1] += wx;
    m[2] += wy;
    m[3] += wxx;
    m[4] += wxy;
    m[5] += wyy;
    m[6] += wxx * x;
    m[7] += wxx * y;
    m[8] += wxy * y;
    m[9] += wyy * y;
    m[10] += wxx * xx;
    m[11] += wxx * xy;
    m[12] += wxx * yy;
    m[13] += wyy * xy;
    m[14] += wyy * yy;
    r[0] += w * z;
    r[1] += wx * z;
    r[2] += wy * z;
    r[3] += wxx * z;
    r[4] += wxy * z;
    r[5] += wyy * z;
  }
  for (std::size_t k = 0; k < 15; ++k) {
    sums.of_terms[k] = 0;
    for (int lane = 0; lane < kLanes; ++lane) sums.of_terms[k] += m[k][lane];
  }
  for (std::size_t k = 0; k < 6; ++k) {
    sums.of_z[k] = 0;
    for (int lane = 0; lane < kLanes; ++lane) sums.of_z[k] += r[k][lane];
  }
}

/// Deviations from the surface of coefficients c, in the points' standard deviations. Returns the
/// largest change.
PENCILSCAN_CLONES float update_deviations(const float* c, const Columns& points) {
  Lanes most = {};
  for (std::size_t i = 0; i < points.size; i += kLanes) {
    Lanes x, y, z, inverse_sigma, before;
    load(points.x + i, x);
    load(points.y + i, y);
    load(points.z + i, z);
    load(points.inverse_sigma + i, inverse_sigma);
    load(points.deviation + i, before);
    const Lanes fitted = c[0] + x * (c[1] + c[3] * x + c[4] * y) + y * (c[2] + c[5] * y);
    const Lanes deviation = (z - fitted) * inverse_sigma;
    store(deviation, points.deviation + i);
    const Lanes change = deviation - before;
    most = change > most ? change : most;
    most = -change > most ? -change : most;
  }
  float largest = 0;
  for (int lane = 0; lane < kLanes; ++lane) largest = std::max(largest, most[lane]);
  return largest;
}

/// Number of deviations of at most `limit`; those of padding, 0, count too.
PENCILSCAN_CLONES std::size_t count_within(const float* deviation, std::size_t size, float limit) {
  IntLanes counts = {};
  for (std::size_t i = 0; i < size; i += kLanes) {
    Lanes d;
    load(deviation + i, d);
    counts -= (d <= limit) & (d >= -limit);
  }
  std::size_t count = 0;
  for (int lane = 0; lane < kLanes; ++lane) count += static_cast<std::size_t>(counts[lane]);
  return count;
}

PENCILSCAN_CLONES void weigh_by_distance(const float* x, const float* y, std::size_t size,
                                         float* near) {
  for (std::size_t i = 0; i < size; i += kLanes) {
    Lanes lx, ly, weight;
    load(x + i, lx);
    load(y + i, ly);
    exponential(-0.5F * (lx * lx + ly * ly), weight);
    store(weight, near + i);
  }
}

}  // namespace

float SurfacePatch::inverse_depth(const Vector2f& at) const {
  return reference * (1 + coefficients.dot(terms((at - pixel) / scale_px)));
}

Vector2f SurfacePatch::gradient(const Vector2f& at) const {
  const Vector2f d = (at - pixel) / scale_px;
  const Vector6f& c = coefficients;
  return reference / scale_px *
         Vector2f(c[1] + 2 * c[3] * d.x() + c[4] * d.y(), c[2] + c[4] * d.x() + 2 * c[5] * d.y());
}

/// Points around a pixel.
struct LocalSurface::Neighborhood {
  std::vector<float> x, y, z, inverse_sigma, near, deviation;
  std::size_t count = 0;
  std::size_t padded = 0;  ///< count, to whole registers

  /// Room for `most` samples; none yet.
  void start(std::size_t most) {
    for (auto* v : {&x, &y, &z, &inverse_sigma, &near, &deviation})
      v->resize(std::max(v->size(), most + kLanes));
    count = 0;
  }
  /// Adds a sample at d if that is wanted.
  void add(const Vector2f& d, const Sample& sample, bool is_wanted) {
    x[count] = d.x();
    y[count] = d.y();
    z[count] = sample.w;
    inverse_sigma[count] = sample.inverse_sigma;
    count += is_wanted ? 1 : 0;
  }
  void finish() {
    padded = (count + kLanes - 1) / kLanes * kLanes;
    for (auto* v : {&x, &y, &z, &inverse_sigma})
      std::fill(v->data() + count, v->data() + padded, 0.F);
    std::fill(deviation.data(), deviation.data() + padded, 0.F);
    weigh_by_distance(x.data(), y.data(), padded, near.data());
  }
  Columns columns() {
    return {x.data(),    y.data(),         z.data(), inverse_sigma.data(),
            near.data(), deviation.data(), padded};
  }
  /// 1.5 times the median of the absolute deviations, at least 1, on a scale of steps of a quarter.
  [[nodiscard]] float scale_of_deviations() const {
    constexpr float kPerMedian = 1.5F;
    constexpr float kStep = 1.25F;
    constexpr float kMost = 1e6F;
    float scale = 1;
    const std::size_t padding = padded - count;
    const auto agreeing = [&] {
      return count_within(deviation.data(), padded, scale / kPerMedian) - padding;
    };
    while (2 * agreeing() <= count && scale < kMost) scale *= kStep;
    return scale;
  }
};

LocalSurface::LocalSurface(const Camera& camera, const LocalSurfaceOptions& options)
    : options_(options),
      center_(camera.center()),
      forward_(camera.forward()),
      floor_(static_cast<float>(options.floor_px / camera.focal_px())),
      columns_((camera.width + options.step_px - 1) / options.step_px),
      rows_((camera.height + options.step_px - 1) / options.step_px),
      cell_columns_(camera.width / kCell + 1),
      cell_rows_(camera.height / kCell + 1),
      cells_(static_cast<std::size_t>(cell_columns_ * cell_rows_)),
      patches_(static_cast<std::size_t>(columns_ * rows_)),
      fitted_to_(patches_.size(), 0),
      refitted_(patches_.size(), 0) {}

int LocalSurface::cell_column(float x) const {
  return std::clamp(static_cast<int>(x) / kCell, 0, cell_columns_ - 1);
}

int LocalSurface::cell_row(float y) const {
  return std::clamp(static_cast<int>(y) / kCell, 0, cell_rows_ - 1);
}

void LocalSurface::add(std::span<const MeasuredPoint> points) {
  for (const MeasuredPoint& p : points) {
    if (!is_on_lattice(p.u, p.v, options_.used_of_seven)) continue;
    const Vec3 way = position_of(p) - center_;
    const float relative = p.sigma / static_cast<float>(way.norm());
    auto& cell = cells_[static_cast<std::size_t>(cell_row(p.v) * cell_columns_ + cell_column(p.u))];
    cell.push_back({Vector2f(p.u, p.v), static_cast<float>(1 / way.dot(forward_)),
                    1 / std::sqrt(relative * relative + floor_ * floor_)});
  }
  Neighborhood around;
  const auto step = static_cast<float>(options_.step_px);
  const auto reach = static_cast<float>(options_.reach_px);
  for (int y = 0; y < rows_; ++y) {
    for (int x = 0; x < columns_; ++x) {
      const Vector2f pixel((static_cast<float>(x) + 0.5F) * step - 0.5F,
                           (static_cast<float>(y) + 0.5F) * step - 0.5F);
      const auto index = static_cast<std::size_t>(y * columns_ + x);
      const std::size_t samples = samples_around(pixel, reach);
      refitted_[index] = samples != fitted_to_[index] ? 1 : 0;
      if (refitted_[index] == 0) continue;
      fitted_to_[index] = samples;
      gather(pixel, reach, around);
      patches_[index] = fit(pixel, reach, around);
      if (patches_[index].exists()) continue;
      // Near a depth step, a smaller neighbourhood may lie on one side of it.
      constexpr float kSmaller = 0.6F;
      gather(pixel, kSmaller * reach, around);
      patches_[index] = fit(pixel, kSmaller * reach, around);
    }
  }
}

std::size_t LocalSurface::patch_index(const Vector2f& pixel) const {
  const auto step = static_cast<float>(options_.step_px);
  const int x = std::clamp(static_cast<int>((pixel.x() + 0.5F) / step), 0, columns_ - 1);
  const int y = std::clamp(static_cast<int>((pixel.y() + 0.5F) / step), 0, rows_ - 1);
  return static_cast<std::size_t>(y * columns_ + x);
}

const SurfacePatch* LocalSurface::nearest(const Vector2f& pixel) const {
  const SurfacePatch& patch = patches_[patch_index(pixel)];
  return patch.exists() ? &patch : nullptr;
}

template <class Visit>
void LocalSurface::for_each_cell(const Vector2f& pixel, float scale, Visit visit) const {
  const float reach = 2 * scale;
  const int left = cell_column(pixel.x() - reach);
  const int right = cell_column(pixel.x() + reach);
  const int top = cell_row(pixel.y() - reach);
  const int bottom = cell_row(pixel.y() + reach);
  for (int y = top; y <= bottom; ++y) {
    for (int x = left; x <= right; ++x)
      visit(cells_[static_cast<std::size_t>(y * cell_columns_ + x)]);
  }
}

std::size_t LocalSurface::samples_around(const Vector2f& pixel, float scale) const {
  std::size_t count = 0;
  for_each_cell(pixel, scale, [&](const std::vector<Sample>& cell) { count += cell.size(); });
  return count;
}

void LocalSurface::gather(const Vector2f& pixel, float scale, Neighborhood& around) const {
  around.start(samples_around(pixel, scale));
  const float per_scale = 1 / scale;
  for_each_cell(pixel, scale, [&](const std::vector<Sample>& cell) {
    for (const Sample& s : cell) {
      const Vector2f d = (s.pixel - pixel) * per_scale;
      around.add(d, s, d.squaredNorm() < 4);
    }
  });
  around.finish();
}

SurfacePatch LocalSurface::fit(const Vector2f& pixel, float scale_px, Neighborhood& around) const {
  constexpr int kIterations = 5;
  constexpr float kSettled = 0.02F;  // largest change of a deviation after which fitting ends
  constexpr float kTuning = 2;       // deviations beyond so many scales count little
  constexpr float kMaxScale = 1.5F;  // points that agree deviate by their sigma
  SurfacePatch patch;
  const std::size_t n = around.count;
  if (n < static_cast<std::size_t>(options_.min_points)) return {};
  patch.pixel = pixel;
  patch.scale_px = scale_px;
  float reference = 0;
  for (std::size_t i = 0; i < n; ++i) reference += around.z[i] / static_cast<float>(n);
  for (std::size_t i = 0; i < n; ++i) around.z[i] = around.z[i] / reference - 1;
  const float curvature_weight = static_cast<float>(1 / (options_.curvature * options_.curvature));
  const auto share = static_cast<float>(1 / options_.alike_points);
  const Columns columns = around.columns();
  Moments sums;
  Eigen::LLT<Matrix6f> factor;
  float scale = 1;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    // First a plane and all points alike, so that one wrong line does not bend it alone.
    const bool first = iteration == 0;
    sum_moments(columns, !first, 1 / (kTuning * scale), sums);
    Matrix6f N = share * quadric_normal_matrix(sums.of_terms);
    N.diagonal().head<3>().array() += 1e-2F;
    N.diagonal().tail<3>().array() += first ? 1e12F : curvature_weight;
    factor.compute(N);
    patch.coefficients = factor.solve(share * Vector6f(sums.of_z.data()));
    const float change = update_deviations(patch.coefficients.data(), columns);
    const float before = scale;
    scale = around.scale_of_deviations();
    if (!first && change < kSettled && scale == before) break;
  }
  float agreeing = 0;
  float chi2 = 0;
  Vector2f mean = Vector2f::Zero();
  int count = 0;
  for (std::size_t i = 0; i < n; ++i) {
    if (std::abs(around.deviation[i]) > 3 * std::min(scale, kMaxScale)) continue;
    agreeing += around.near[i];
    chi2 += around.near[i] * around.deviation[i] * around.deviation[i];
    mean += around.near[i] * Vector2f(around.x[i], around.y[i]);
    ++count;
  }
  if (count < options_.min_points ||
      static_cast<float>(count) <
          static_cast<float>(options_.min_agreement) * static_cast<float>(n))
    return {};
  patch.reference = reference;
  patch.spread = std::sqrt(chi2 / agreeing);
  patch.one_sidedness = mean.norm() / agreeing;
  const float variance = factor.solve(Vector6f::Unit(0))[0];
  patch.sigma = std::sqrt(std::max(0.F, variance)) * std::max(1.F, patch.spread);
  return patch;
}

}  // namespace pencilscan
