#include "pencilscan/solution/local_surface.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

namespace pencilscan {
namespace {

using Eigen::Vector2f;
using Vector6f = Eigen::Matrix<float, 6, 1>;
using Matrix6f = Eigen::Matrix<float, 6, 6>;
using Lanes = Eigen::Array<float, 8, 1>;

Vector6f terms(const Vector2f& d) {
  Vector6f row;
  row << 1, d.x(), d.y(), d.x() * d.x(), d.x() * d.y(), d.y() * d.y();
  return row;
}

/// Weighted least squares of z on the six terms: normal matrix and right side. The matrix holds the
/// 15 moments sum(w x^a y^b), a + b <= 4.
void accumulate(const float* x, const float* y, const float* z, const float* w, std::size_t n,
                Matrix6f& N, Vector6f& b) {
  std::array<Lanes, 15> m;
  std::array<Lanes, 6> r;
  for (Lanes& lanes : m) lanes.setZero();
  for (Lanes& lanes : r) lanes.setZero();
  for (std::size_t i = 0; i < n; i += Lanes::SizeAtCompileTime) {
    const Lanes lx = Eigen::Map<const Lanes>(x + i);
    const Lanes ly = Eigen::Map<const Lanes>(y + i);
    const Lanes lz = Eigen::Map<const Lanes>(z + i);
    const Lanes m0 = Eigen::Map<const Lanes>(w + i);
    const Lanes mx = m0 * lx;
    const Lanes my = m0 * ly;
    const Lanes mxx = mx * lx;
    const Lanes mxy = mx * ly;
    const Lanes myy = my * ly;
    const Lanes x2 = lx * lx;
    const Lanes y2 = ly * ly;
    const Lanes xy = lx * ly;
    m[0] += m0;
    m[1] += mx;
    m[2] += my;
    m[3] += mxx;
    m[4] += mxy;
    m[5] += myy;
    m[6] += mxx * lx;
    m[7] += mxx * ly;
    m[8] += mxy * ly;
    m[9] += myy * ly;
    m[10] += mxx * x2;
    m[11] += mxx * xy;
    m[12] += mxx * y2;
    m[13] += myy * xy;
    m[14] += myy * y2;
    r[0] += m0 * lz;
    r[1] += mx * lz;
    r[2] += my * lz;
    r[3] += mxx * lz;
    r[4] += mxy * lz;
    r[5] += myy * lz;
  }
  std::array<float, 15> s;
  for (std::size_t k = 0; k < s.size(); ++k) s[k] = m[k].sum();
  for (std::size_t k = 0; k < r.size(); ++k) b[static_cast<Eigen::Index>(k)] = r[k].sum();
  N << s[0], s[1], s[2], s[3], s[4], s[5],    //
      s[1], s[3], s[4], s[6], s[7], s[8],     //
      s[2], s[4], s[5], s[7], s[8], s[9],     //
      s[3], s[6], s[7], s[10], s[11], s[12],  //
      s[4], s[7], s[8], s[11], s[12], s[13],  //
      s[5], s[8], s[9], s[12], s[13], s[14];
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

/// Points around a pixel as columns, padded by points without weight to full registers.
struct LocalSurface::Neighborhood {
  std::vector<float> x, y, z, sigma, near, weight, deviation, scratch;
  std::size_t count = 0;

  void clear() {
    for (auto* v : {&x, &y, &z, &sigma, &near}) v->clear();
    count = 0;
  }
  void add(const Vector2f& d, float w, float s) {
    x.push_back(d.x());
    y.push_back(d.y());
    z.push_back(w);
    sigma.push_back(s);
    near.push_back(std::exp(-0.5F * d.squaredNorm()));
    ++count;
  }
  void pad() {
    while (x.size() % static_cast<std::size_t>(Lanes::SizeAtCompileTime) != 0) {
      for (auto* v : {&x, &y, &z, &near}) v->push_back(0);
      sigma.push_back(1);
    }
    weight.resize(x.size());
    deviation.assign(x.size(), 0.F);
  }
  [[nodiscard]] float median(const std::vector<float>& values) {
    scratch.assign(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(count));
    for (float& v : scratch) v = std::abs(v);
    const auto middle = scratch.begin() + static_cast<std::ptrdiff_t>(count / 2);
    std::nth_element(scratch.begin(), middle, scratch.end());
    return *middle;
  }
};

LocalSurface::LocalSurface(const Camera& camera, std::span<const MeasuredPoint> points,
                           const LocalSurfaceOptions& options)
    : options_(options),
      columns_((camera.width + options.step_px - 1) / options.step_px),
      rows_((camera.height + options.step_px - 1) / options.step_px),
      cell_columns_(camera.width / kCell + 1),
      cell_rows_(camera.height / kCell + 1) {
  cells_.resize(static_cast<std::size_t>(cell_columns_ * cell_rows_));
  const Vec3 center = camera.center();
  const Vec3 forward = camera.forward();
  const auto floor = static_cast<float>(options.floor_px / camera.K(0, 0));
  for (std::size_t i = 0; i < points.size(); i += static_cast<std::size_t>(options.thinning)) {
    const MeasuredPoint& p = points[i];
    const Vec3 way = Vec3(p.x, p.y, p.z) - center;
    const int x = std::clamp(static_cast<int>(p.u) / kCell, 0, cell_columns_ - 1);
    const int y = std::clamp(static_cast<int>(p.v) / kCell, 0, cell_rows_ - 1);
    cells_[static_cast<std::size_t>(y * cell_columns_ + x)].push_back(
        {Vector2f(p.u, p.v), static_cast<float>(1 / way.dot(forward)),
         std::hypot(p.sigma / static_cast<float>(way.norm()), floor)});
  }
  Neighborhood around;
  patches_.resize(static_cast<std::size_t>(columns_ * rows_));
  const auto step = static_cast<float>(options.step_px);
  for (int y = 0; y < rows_; ++y) {
    for (int x = 0; x < columns_; ++x) {
      const Vector2f pixel((static_cast<float>(x) + 0.5F) * step - 0.5F,
                           (static_cast<float>(y) + 0.5F) * step - 0.5F);
      SurfacePatch& patch = patches_[static_cast<std::size_t>(y * columns_ + x)];
      // Near a depth step, a smaller neighbourhood may lie on one side of it.
      for (const float share : {1.F, 0.6F}) {
        gather(pixel, share * static_cast<float>(options.reach_px), around);
        patch = fit(pixel, share * static_cast<float>(options.reach_px), around);
        if (patch.exists()) break;
      }
    }
  }
}

const SurfacePatch* LocalSurface::nearest(const Vector2f& pixel) const {
  const int x = static_cast<int>((pixel.x() + 0.5F) / static_cast<float>(options_.step_px));
  const int y = static_cast<int>((pixel.y() + 0.5F) / static_cast<float>(options_.step_px));
  if (x < 0 || y < 0 || x >= columns_ || y >= rows_) return nullptr;
  const SurfacePatch& patch = patches_[static_cast<std::size_t>(y * columns_ + x)];
  return patch.exists() ? &patch : nullptr;
}

void LocalSurface::gather(const Vector2f& pixel, float scale, Neighborhood& around) const {
  around.clear();
  const float reach = 2 * scale;
  const auto column = [&](float x) {
    return std::clamp(static_cast<int>(x) / kCell, 0, cell_columns_ - 1);
  };
  const auto row = [&](float y) {
    return std::clamp(static_cast<int>(y) / kCell, 0, cell_rows_ - 1);
  };
  for (int y = row(pixel.y() - reach); y <= row(pixel.y() + reach); ++y) {
    for (int x = column(pixel.x() - reach); x <= column(pixel.x() + reach); ++x) {
      for (const Sample& s : cells_[static_cast<std::size_t>(y * cell_columns_ + x)]) {
        const Vector2f d = (s.pixel - pixel) / scale;
        if (d.squaredNorm() < 4) around.add(d, s.w, s.sigma);
      }
    }
  }
  if (around.count > 0) around.pad();
}

SurfacePatch LocalSurface::fit(const Vector2f& pixel, float scale_px, Neighborhood& around) const {
  constexpr int kIterations = 5;
  constexpr float kTuning = 2;       // deviations beyond so many scales count little
  constexpr float kMaxScale = 1.5F;  // points that agree deviate by their sigma
  SurfacePatch patch;
  const std::size_t n = around.count;
  if (n < static_cast<std::size_t>(options_.min_points)) return {};
  patch.pixel = pixel;
  patch.scale_px = scale_px;
  const float reference = around.median(around.z);
  for (std::size_t i = 0; i < n; ++i) around.z[i] = around.z[i] / reference - 1;
  const auto curvature = static_cast<float>(options_.curvature);
  const auto alike = static_cast<float>(options_.alike_points);
  Matrix6f N;
  Vector6f b;
  float scale = 1;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    for (std::size_t i = 0; i < around.x.size(); ++i) {
      const float e = around.deviation[i] / (kTuning * scale);
      const float robust = 1 / (1 + e * e);
      // First a plane and all points alike, so that one wrong line does not bend it alone.
      const float near = iteration == 0 ? 1.F : around.near[i];
      around.weight[i] = near * robust * robust / (alike * around.sigma[i] * around.sigma[i]);
    }
    accumulate(around.x.data(), around.y.data(), around.z.data(), around.weight.data(),
               around.x.size(), N, b);
    N.diagonal().head<3>().array() += 1e-2F;
    N.diagonal().tail<3>().array() += iteration == 0 ? 1e12F : 1 / (curvature * curvature);
    patch.coefficients = N.selfadjointView<Eigen::Lower>().ldlt().solve(b);
    const Vector6f& c = patch.coefficients;
    for (std::size_t i = 0; i < n; ++i) {
      const float x = around.x[i];
      const float y = around.y[i];
      const float predicted =
          c[0] + c[1] * x + c[2] * y + c[3] * x * x + c[4] * x * y + c[5] * y * y;
      around.deviation[i] = (around.z[i] - predicted) / around.sigma[i];
    }
    scale = std::max(1.F, 1.5F * around.median(around.deviation));
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
  const Vector6f center = Vector6f::Unit(0);
  const float variance = N.selfadjointView<Eigen::Lower>().ldlt().solve(center)[0];
  patch.sigma = std::sqrt(std::max(0.F, variance)) * std::max(1.F, patch.spread);
  return patch;
}

}  // namespace pencilscan
