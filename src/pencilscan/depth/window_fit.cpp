#include "pencilscan/depth/window_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace pencilscan {
namespace {

constexpr float kLeastSpacingPx = 2.5F;  // closer lines are blurred away

constexpr float kLeastShare = 0.15F;  // of the largest amplitude, to be called lit

/// Amplitude / deviation, to be called lit. Of the 6 million windows and patterns of a frame, noise
/// alone takes one beyond 5 deviations. In full windows 8 are asked, which also keeps out what a
/// surface that is no quadric makes; that does not grow with the number of samples.
float least_significance(float sampled_share) {
  return std::max(5.F, 8.F * std::sqrt(sampled_share));
}

constexpr double kBow = 6;  // footprints over the window's half, of the prior on curvature
constexpr double kRidge = 1e-6;
constexpr double kLongestStep = 0.15;  // lines, within which the profile is well linear
constexpr double kAtRest = 2e-3;       // lines
constexpr float kLeastAmplitude = 0.003F;

}  // namespace

Quadric quadric_at(const DepthNode& node, const Vec2& way, int half) {
  const double wx = node.wx, wy = node.wy, wxx = node.wxx, wxy = node.wxy, wyy = node.wyy;
  const double dx = way[0], dy = way[1], h = half;
  Quadric q;
  q[0] = node.w + wx * dx + wy * dy + 0.5 * (wxx * dx * dx + 2 * wxy * dx * dy + wyy * dy * dy);
  q[1] = h * (wx + wxx * dx + wxy * dy);
  q[2] = h * (wy + wxy * dx + wyy * dy);
  q[3] = 0.5 * h * h * wxx;
  q[4] = h * h * wxy;
  q[5] = 0.5 * h * h * wyy;
  return q;
}

void set_quadric(const Quadric& q, int half, DepthNode& node) {
  const double h = half;
  node.w = static_cast<float>(q[0]);
  node.wx = static_cast<float>(q[1] / h);
  node.wy = static_cast<float>(q[2] / h);
  node.wxx = static_cast<float>(2 * q[3] / (h * h));
  node.wxy = static_cast<float>(q[4] / (h * h));
  node.wyy = static_cast<float>(2 * q[5] / (h * h));
}

WindowFitter::WindowFitter(const CameraLight& light, int half)
    : light_(&light), grid_(half), parts_(grid_), of_family_(grid_, light.patterns.size()) {
  valid_.assign(grid_.padded, 0.F);
  w_ = valid_;
  const std::size_t patterns = light.patterns.size();
  seen_.resize(light.families.size());
  for (Seen& seen : seen_) {
    seen.image = seen.weight = seen.root = valid_;
    seen.light.profile.resize(patterns);
    seen.light.slope.resize(patterns);
    seen.light.amplitude.resize(patterns);
  }
  profile_.assign(patterns, valid_);
  slope_ = profile_;
}

bool WindowFitter::gather(int u, int v) {
  const cv::Mat& first = light_->families.front();
  const int half = grid_.half;
  if (u < half || v < half || u + half >= first.cols || v + half >= first.rows) return false;
  // take(index in the grid, pointers to the row's pixels in the images)
  const auto for_rows = [&](auto take) {
    for (const WindowGrid::Row& row : grid_.rows)
      take(static_cast<std::size_t>(row.first), v + row.dv, u + row.least_du,
           static_cast<std::size_t>(row.pixels));
  };
  /// Weight 0 where the mask is; how often it is.
  const auto leave_out = [&](const cv::Mat& mask, std::vector<float>& weight) {
    int without = 0;
    for_rows([&](std::size_t at, int image_row, int column, std::size_t pixels) {
      const std::uint8_t* values = mask.ptr<std::uint8_t>(image_row) + column;
      for (std::size_t i = 0; i < pixels; ++i) {
        if (values[i] != 0) continue;
        weight[at + i] = 0;
        ++without;
      }
    });
    return without;
  };
  std::copy(grid_.taper.begin(), grid_.taper.end(), valid_.begin());
  if (2 * leave_out(light_->valid, valid_) > grid_.count) return false;
  for (std::size_t f = 0; f < seen_.size(); ++f) {
    Seen& seen = seen_[f];
    std::copy(valid_.begin(), valid_.end(), seen.weight.begin());
    seen.sampled_share = 1;
    if (!light_->sampled[f].empty()) {
      const int without = leave_out(light_->sampled[f], seen.weight);
      seen.sampled_share = 1 - static_cast<float>(without) / static_cast<float>(grid_.count);
    }
    set_weight(seen);
    for_rows([&](std::size_t at, int image_row, int column, std::size_t pixels) {
      const float* values = light_->families[f].ptr<float>(image_row) + column;
      std::copy(values, values + pixels, seen.image.data() + at);
    });
    float sum = 0;
    sum_parts(grid_, seen.image.data(), seen.weight.data(), 1, &sum);
    seen.mean = seen.weight_sum > 0 ? sum / seen.weight_sum : 0.F;
    seen.inverse_variance = 1 / light_->noise[f].variance(seen.mean);
  }
  return true;
}

void WindowFitter::set_weight(Seen& seen) {
  for (std::size_t i = 0; i < grid_.padded; ++i) seen.root[i] = std::sqrt(seen.weight[i]);
  sum_parts(grid_, seen.weight.data(), grid_.monomial(0), 1, &seen.weight_sum);
}

void WindowFitter::choose_patterns(const Quadric& q) {
  lit_.clear();
  const auto w = static_cast<float>(q[0]);
  const auto wx = static_cast<float>(q[1] / grid_.half);
  const auto wy = static_cast<float>(q[2] / grid_.half);
  // w = omega . (x, y, 1) over normalised pixels: the normal towards the camera is -omega.
  const Vec2 slope = jacobian_.transpose().inverse() * Vec2(q[1], q[2]) / grid_.half;
  const Vec3 normal = -Vec3(slope[0], slope[1], q[0] - slope.dot(m_)).normalized();
  const Vec3 x = m_.homogeneous() / q[0];
  for (std::size_t k = 0; k < light_->patterns.size(); ++k) {
    const PatternView& view = light_->patterns[k];
    if ((view.center() - x).dot(normal) <= 0) continue;
    bool ok = false;
    Lit lit;
    lit.lines = view.lines(m_, jacobian_, q[0], ok);
    if (!ok) continue;
    const float gradient = lit.lines.gradient(w, wx, wy).norm();
    if (gradient * kLeastSpacingPx > 1) continue;
    const float reach = std::max(3 * light_->blur_px * gradient, 0.02F);
    lit.inverse_reach = 1 / reach;
    lit.pattern = static_cast<int>(k);
    lit.family = view.family();
    lit_.push_back(lit);
  }
}

// A point of the plane omega . X = 1 that rises by h along the normal n = -omega / |omega| gains
// h w |omega| of inverse depth over the plane, and moves by h w (n_xy - m n_z) in the image.
WindowSurface WindowFitter::surface_of(const Quadric& q) const {
  const Vec2 slope = jacobian_.transpose().inverse() * Vec2(q[1], q[2]) / grid_.half;
  const double along = q[0] - slope.dot(m_);
  const Vec2 way = (m_ * along - slope) / (slope.squaredNorm() + along * along);
  const Vec2 lean = jacobian_.inverse() * way / grid_.half;
  WindowSurface surface{};
  for (int k = 0; k < 6; ++k) surface.p[k] = static_cast<float>(q[k]);
  for (int k = 0; k < 2; ++k) surface.lean[k] = static_cast<float>(lean[k]);
  return surface;
}

void WindowFitter::render(const Quadric& q) {
  surface_depths(grid_, surface_of(q), w_.data());
  const auto scale = static_cast<float>(grid_.half);
  for (std::size_t k = 0; k < lit_.size(); ++k) {
    if (!lit_[k].on) continue;
    const Eigen::Vector4f& n = lit_[k].lines.n;
    const Eigen::Vector4f& d = lit_[k].lines.d;
    const WindowLineShape shape{
        {n[0], scale * n[1], scale * n[2], n[3]},
        {d[0], scale * d[1], scale * d[2], d[3]},
        light_->patterns[static_cast<std::size_t>(lit_[k].pattern)].half_width(),
        lit_[k].inverse_reach};
    render_lines(grid_, shape, w_.data(), profile_[k].data(), slope_[k].data());
  }
}

void WindowFitter::collect(std::size_t family) {
  FamilyLight& light = seen_[family].light;
  light.patterns = 0;
  for (std::size_t k = 0; k < lit_.size(); ++k) {
    if (!lit_[k].on || lit_[k].family != static_cast<int>(family)) continue;
    const auto at = static_cast<std::size_t>(light.patterns);
    light.profile[at] = profile_[k].data();
    light.slope[at] = slope_[k].data();
    light.amplitude[at] = lit_[k].amplitude;
    ++light.patterns;
  }
}

void WindowFitter::solve_amplitudes() {
  for (std::size_t f = 0; f < seen_.size(); ++f) solve_amplitudes(f);
}

void WindowFitter::solve_amplitudes(std::size_t family) {
  Seen& seen = seen_[family];
  seen.light.ex = seen.light.ey = 0;
  seen.light.offset = 0;
  thread_local std::vector<std::size_t> mine;
  thread_local std::vector<int> columns;  // those of `mine`, then of the offset
  mine.clear();
  columns.clear();
  for (std::size_t k = 0; k < lit_.size(); ++k) {
    lit_[k].amplitude = lit_[k].family == static_cast<int>(family) ? 0.F : lit_[k].amplitude;
    if (lit_[k].on && lit_[k].family == static_cast<int>(family)) mine.push_back(k);
  }
  collect(family);
  of_family_.sum_light(seen.light, seen.image.data(), seen.root.data());
  const int image = static_cast<int>(mine.size()) + 1;
  for (int k = 0; k <= static_cast<int>(mine.size()); ++k) columns.push_back(k);
  using Dense = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic>;
  thread_local Dense A;
  thread_local Eigen::VectorXd amplitudes;
  while (true) {
    const auto n = static_cast<Eigen::Index>(columns.size());
    A.resize(n, n);
    amplitudes.resize(n);
    const auto product = [&](Eigen::Index i, int j) {
      return of_family_.product(columns[static_cast<std::size_t>(i)], j);
    };
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index j = 0; j < n; ++j)
        A(i, j) = product(i, columns[static_cast<std::size_t>(j)]);
      amplitudes[i] = product(i, image);
      A(i, i) += 1e-4 * A(i, i) + 1e-9;
    }
    A.llt().solveInPlace(amplitudes);
    seen.light.offset = static_cast<float>(amplitudes[n - 1]);
    Eigen::Index worst = -1;
    for (Eigen::Index i = 0; i + 1 < n; ++i) {
      lit_[mine[static_cast<std::size_t>(i)]].amplitude = static_cast<float>(amplitudes[i]);
      if (amplitudes[i] < 0.005 && (worst < 0 || amplitudes[i] < amplitudes[worst])) worst = i;
    }
    if (worst < 0) break;
    lit_[mine[static_cast<std::size_t>(worst)]].on = false;
    mine.erase(mine.begin() + worst);
    columns.erase(columns.begin() + worst);
  }
}

void WindowFitter::add_family(std::size_t family, float unit) {
  Seen& seen = seen_[family];
  of_family_.sum(seen.light, seen.image.data(), seen.root.data(), unit);
  const int residual = FamilyColumns::residual(seen.light.patterns);
  const double rss = of_family_.product(residual, residual);
  const auto certainty = static_cast<double>(seen.inverse_variance);
  seen.variance = static_cast<float>(rss) / std::max(seen.weight_sum, 1e-6F);
  chi2_ += rss * certainty;
  degrees_ += static_cast<double>(seen.weight_sum);
  // Without lines of a family, it says nothing of depth.
  if (seen.light.patterns > 0) of_family_.add(seen.light, certainty, family, equations_);
}

bool WindowFitter::evaluate(const Quadric& q) {
  equations_.reset(seen_.size());
  chi2_ = degrees_ = 0;
  // Inverse depth in units of the present one: unknowns of like size.
  const auto unit = static_cast<float>(q[0]);
  for (std::size_t f = 0; f < seen_.size(); ++f) {
    collect(f);
    add_family(f, unit);
    int next = 0;
    for (Lit& lit : lit_) {
      if (lit.on && lit.family == static_cast<int>(f)) lit.unknown = next++;
    }
  }
  const double bow = kBow * q[0];
  for (int c = 3; c < 6; ++c) {
    equations_.surface[c][c] += 1 / (bow * bow);
    equations_.surface[c][6] -= q[c] / q[0] / (bow * bow);
  }
  return equations_.eliminate(kRidge);
}

double WindowFitter::step(Quadric& q) {
  const WindowEquations::Surface delta = equations_.solve_surface();
  double most = 0;
  for (const Lit& lit : lit_) {
    if (!lit.on) continue;
    const auto slope = static_cast<double>(lit.lines.slope(static_cast<float>(q[0])));
    most = std::max(most, std::abs(delta[0] * q[0] * slope));
  }
  const double limit = most > kLongestStep ? kLongestStep / most : 1.0;
  const double scale = limit * q[0];
  q += scale * delta;
  thread_local std::vector<double> change;
  for (std::size_t f = 0; f < seen_.size(); ++f) {
    FamilyLight& light = seen_[f].light;
    if (light.patterns == 0) continue;
    equations_.solve_light(f, delta, change);
    const auto moved = [&](int unknown) {
      return static_cast<float>(limit * change[static_cast<std::size_t>(unknown)]);
    };
    for (Lit& lit : lit_) {
      if (!lit.on || lit.family != static_cast<int>(f)) continue;
      lit.amplitude += moved(lit.unknown);
      if (lit.amplitude < kLeastAmplitude) lit.on = false;
    }
    light.offset += moved(light.patterns);
    light.ex = std::clamp(light.ex + moved(light.patterns + 1), -0.8F, 0.8F);
    light.ey = std::clamp(light.ey + moved(light.patterns + 2), -0.8F, 0.8F);
  }
  return most;
}

bool WindowFitter::iterate(Quadric& q, int rounds) {
  for (int round = 0; round < rounds; ++round) {
    if (!evaluate(q)) return false;
    const double moved = step(q);
    if (!(moved < 1e6) || !q.allFinite() || !(q[0] > 0)) return false;
    if (std::none_of(lit_.begin(), lit_.end(), [](const Lit& l) { return l.on; })) return false;
    // The blur follows the slope of the surface.
    const auto w = static_cast<float>(q[0]);
    const auto wx = static_cast<float>(q[1] / grid_.half);
    const auto wy = static_cast<float>(q[2] / grid_.half);
    for (Lit& lit : lit_) {
      const float gradient = lit.lines.gradient(w, wx, wy).norm();
      lit.inverse_reach = 1 / std::clamp(3 * light_->blur_px * gradient, 0.02F, 2.F);
    }
    render(q);
    if (moved < kAtRest) break;
  }
  return evaluate(q);
}

bool WindowFitter::cut_at_edge() {
  constexpr float kOfBlur = 2;  // deviations: from there inwards 98 % of the light is left
  constexpr float kRounding = 1e-4F;
  const auto edge = parts_.edge(static_cast<float>(chi2_ / degrees_));
  if (!edge) return false;
  const float within_px = std::max(0.F, edge->offset - kOfBlur * light_->blur_px);
  const float within = within_px / static_cast<float>(grid_.half) + kRounding;
  const float* x = grid_.monomial(1);
  const float* y = grid_.monomial(2);
  for (Seen& seen : seen_) {
    for (std::size_t i = 0; i < grid_.padded; ++i) {
      if (x[i] * edge->cosine + y[i] * edge->sine > within) seen.weight[i] = 0;
    }
    set_weight(seen);
  }
  return true;
}

void WindowFitter::compare_light() {
  parts_.reset();
  for (std::size_t f = 0; f < seen_.size(); ++f) {
    const Seen& seen = seen_[f];
    collect(f);
    parts_.add(seen.light, seen.image.data(), seen.weight.data(), seen.inverse_variance);
  }
  parts_.sum_up();
}

std::optional<WindowFit> WindowFitter::finish(const Quadric& q, bool cut) {
  WindowFit fit;
  fit.q = q;
  fit.cut = cut;
  fit.misfit = static_cast<float>(chi2_ / degrees_);
  const double inflate = std::max(1.0, chi2_ / degrees_);
  const double unit2 = inflate * q[0] * q[0];
  fit.variance = equations_.surface_variance() * unit2;
  fit.information = equations_.surface_information() / unit2;
  for (const Lit& lit : lit_) {
    if (lit.on) fit.amplitude = std::max(fit.amplitude, lit.amplitude);
  }
  for (const Lit& lit : lit_) {
    if (!lit.on || lit.amplitude < kLeastShare * fit.amplitude) continue;
    const auto family = static_cast<std::size_t>(lit.family);
    const double variance = inflate * equations_.light_variance(family, lit.unknown);
    const float least = least_significance(seen_[family].sampled_share);
    if (lit.amplitude < least * std::sqrt(static_cast<float>(variance))) continue;
    fit.lit.set(static_cast<std::size_t>(lit.pattern));
    fit.lines_per_w =
        std::max(fit.lines_per_w, std::abs(lit.lines.slope(static_cast<float>(q[0]))));
  }
  if (fit.lit.none() || !(fit.variance > 0)) return std::nullopt;
  float residual = 0;
  for (const Seen& seen : seen_) residual = std::max(residual, seen.variance);
  fit.relative_residual = std::sqrt(residual) / fit.amplitude;
  return fit;
}

std::optional<WindowFit> WindowFitter::fit(const Vec2& pixel, const Quadric& start, int rounds) {
  if (!(start[0] > 0) || !start.allFinite()) return std::nullopt;
  const int u = static_cast<int>(std::lround(pixel[0]));
  const int v = static_cast<int>(std::lround(pixel[1]));
  if (!gather(u, v)) return std::nullopt;
  m_ = light_->camera->normalized_from_pixel(pixel);
  jacobian_ = light_->camera->pixel_slope(m_).inverse();
  Quadric q = start;
  const auto fit_window = [&] {
    choose_patterns(q);
    if (lit_.empty()) return false;
    render(q);
    solve_amplitudes();
    if (!iterate(q, rounds)) return false;
    compare_light();
    return true;
  };
  if (!fit_window()) return std::nullopt;
  // Where the surface ends within the window, fit what is left of it: within two edges at most, as
  // at a corner, or within the one that the better fit shows.
  constexpr int kEdges = 2;
  int edges = 0;
  for (; edges < kEdges && cut_at_edge(); ++edges) {
    if (!fit_window()) return std::nullopt;
  }
  const std::optional<std::size_t> side = parts_.dark_side();
  if (side) {
    const float* beyond = parts_.side(*side);
    for (Seen& seen : seen_) {
      for (std::size_t i = 0; i < grid_.padded; ++i) seen.weight[i] *= 1.F - beyond[i];
      set_weight(seen);
    }
    if (!fit_window() || parts_.dark_side()) return std::nullopt;
  }
  // The centre itself must show the light that is predicted there.
  if (parts_.is_middle_dark()) return std::nullopt;
  return finish(q, edges > 0 || side.has_value());
}

}  // namespace pencilscan
