#include "pencilscan/depth/window_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "pencilscan/depth/gram.h"

namespace pencilscan {
namespace {

constexpr float kLeastSpacingPx = 2.5F;  // closer lines are blurred away

/// Integral of the triweight kernel from -1, u clamped.
template <typename Array>
auto bell_integral(const Array& u) {
  const auto u2 = u * u;
  return 0.5F + (35.F / 32) * u * (1.F + u2 * (-1.F + u2 * (0.6F - u2 * (1.F / 7))));
}

constexpr float kLeastShare = 0.15F;  // of the largest amplitude, to be called lit

/// Amplitude / deviation, to be called lit. Of the 6 million windows and patterns of a frame, noise
/// alone takes one beyond 5 deviations. In full windows 8 are asked, which also keeps out what a
/// surface that is no quadric makes; that does not grow with the number of samples.
float least_significance(float sampled_share) {
  return std::max(5.F, 8.F * std::sqrt(sampled_share));
}

constexpr float kSideStart = 0.2F;    // of the radius: where a side of the window begins
constexpr float kLeastLight = 0.6F;   // share of the predicted light that a side must show ...
constexpr float kLeastEnergy = 40.F;  // ... where that would be beyond noise
constexpr float kMiddle2 = 0.2F;      // squared radius of the middle, in radii

using Dense = Eigen::MatrixXd;
using DenseVector = Eigen::VectorXd;

}  // namespace

WindowFitter::WindowFitter(const CameraLight& light, int half) : light_(&light), half_(half) {
  const double radius2 = (half + 0.5) * (half + 0.5);
  for (int dv = -half; dv <= half; ++dv) {
    for (int du = -half; du <= half; ++du) {
      if (du * du + dv * dv > radius2) continue;
      du_.push_back(du);
      dv_.push_back(dv);
    }
  }
  count_ = static_cast<int>(du_.size());
  padded_ = (count_ + 7) / 8 * 8;
  x_ = y_ = taper_ = Column::Zero(padded_);
  for (int i = 0; i < count_; ++i) {
    const auto k = static_cast<std::size_t>(i);
    x_[i] = static_cast<float>(du_[k]) / static_cast<float>(half);
    y_[i] = static_cast<float>(dv_[k]) / static_cast<float>(half);
    // Pixels far from the centre say less about it: the quadric holds less well there.
    taper_[i] = 1.F - 0.5F * (x_[i] * x_[i] + y_[i] * y_[i]);
  }
  taper_ = taper_.max(0.F);
  xx_ = x_ * x_;
  xy_ = x_ * y_;
  yy_ = y_ * y_;
  const auto zero_or_one = [](const auto& condition) -> Column {
    return condition.template cast<float>();
  };
  middle_ = zero_or_one(xx_ + yy_ < kMiddle2);
  for (std::size_t k = 0; k < beyond_.size(); ++k) {
    const double angle =
        2 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(beyond_.size());
    beyond_[k] = zero_or_one(x_ * static_cast<float>(std::cos(angle)) +
                                 y_ * static_cast<float>(std::sin(angle)) >
                             kSideStart);
  }
  const std::size_t families = light.families.size();
  image_.assign(families, Column::Zero(padded_));
  weight_ = root_ = image_;
  weight_sum_.assign(families, 0.F);
  sampled_share_.assign(families, 1.F);
  offset_.assign(families, 0.F);
  ex_ = ey_ = inverse_variance_ = mean_ = variance_ = offset_;
  profile_.assign(light.patterns.size(), Column::Zero(padded_));
  slope_ = profile_;
  J_.resize(padded_, 6 + static_cast<Eigen::Index>(light.patterns.size()) + 4);
}

bool WindowFitter::gather(int u, int v) {
  const cv::Mat& first = light_->families.front();
  if (u < half_ || v < half_ || u + half_ >= first.cols || v + half_ >= first.rows) return false;
  int used = 0;
  thread_local Column valid, weight;
  valid = taper_;
  for (int i = 0; i < count_; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (light_->valid.at<std::uint8_t>(v + dv_[k], u + du_[k]) == 0) {
      valid[i] = 0;
    } else {
      ++used;
    }
  }
  if (used * 2 < count_) return false;
  for (std::size_t f = 0; f < image_.size(); ++f) {
    weight = valid;
    sampled_share_[f] = 1;
    if (!light_->sampled[f].empty()) {
      int without = 0;
      for (int i = 0; i < count_; ++i) {
        const auto k = static_cast<std::size_t>(i);
        if (light_->sampled[f].at<std::uint8_t>(v + dv_[k], u + du_[k]) != 0) continue;
        weight[i] = 0;
        ++without;
      }
      sampled_share_[f] = 1 - static_cast<float>(without) / static_cast<float>(count_);
    }
    set_weight(f, weight);
    for (int i = 0; i < count_; ++i) {
      const auto k = static_cast<std::size_t>(i);
      image_[f][i] = light_->families[f].at<float>(v + dv_[k], u + du_[k]);
    }
    mean_[f] = weight_sum_[f] > 0 ? (weight_[f] * image_[f]).sum() / weight_sum_[f] : 0.F;
    inverse_variance_[f] = 1 / light_->noise[f].variance(mean_[f]);
  }
  return true;
}

void WindowFitter::set_weight(std::size_t family, const Column& weight) {
  weight_[family] = weight;
  root_[family] = weight.sqrt();
  weight_sum_[family] = weight.sum();
}

void WindowFitter::choose_patterns(const Vec2& m, const Eigen::Matrix2d& jacobian,
                                   const Quadric& q) {
  lit_.clear();
  const auto w = static_cast<float>(q[0]);
  const auto wx = static_cast<float>(q[1] / half_);
  const auto wy = static_cast<float>(q[2] / half_);
  // w = omega . (x, y, 1) over normalised pixels: the normal towards the camera is -omega.
  const Vec2 slope = jacobian.transpose().inverse() * Vec2(q[1], q[2]) / half_;
  const Vec3 normal = -Vec3(slope[0], slope[1], q[0] - slope.dot(m)).normalized();
  const Vec3 x = m.homogeneous() / q[0];
  for (std::size_t k = 0; k < light_->patterns.size(); ++k) {
    const PatternView& view = light_->patterns[k];
    if ((view.center() - x).dot(normal) <= 0) continue;
    bool ok = false;
    Lit lit;
    lit.lines = view.lines(m, jacobian, q[0], ok);
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

void WindowFitter::render(const Quadric& q) {
  const Eigen::Matrix<float, 6, 1> p = q.cast<float>();
  w_ = p[0] + p[1] * x_ + p[2] * y_ + p[3] * xx_ + p[4] * xy_ + p[5] * yy_;
  const auto scale = static_cast<float>(half_);
  thread_local Column line, inverse, a, u1, u2, u3;
  for (std::size_t k = 0; k < lit_.size(); ++k) {
    if (!lit_[k].on) continue;
    const Eigen::Vector4f& n = lit_[k].lines.n;
    const Eigen::Vector4f& d = lit_[k].lines.d;
    const float h = light_->patterns[static_cast<std::size_t>(lit_[k].pattern)].half_width();
    const float r = lit_[k].inverse_reach;
    inverse = 1.F / (d[0] + scale * d[1] * x_ + scale * d[2] * y_ + d[3] * w_);
    line = (n[0] + scale * n[1] * x_ + scale * n[2] * y_ + n[3] * w_) * inverse;
    // Distance to the nearest line; adding and subtracting 1.5 * 2^23 rounds a float.
    constexpr float kRound = 12582912.F;
    a = line - ((line + kRound) - kRound);
    u1 = ((a.abs() + h) * r).min(1.F);
    u2 = ((a.abs() - h) * r).max(-1.F).min(1.F);
    u3 = ((1.F - a.abs() - h) * r).max(-1.F).min(1.F);
    // This line and the next one on the nearer side.
    profile_[k] = bell_integral(u1) - bell_integral(u2) + 1.F - bell_integral(u3);
    const auto bell = [](const Column& u) { return (1.F - u * u).cube(); };
    const float kernel = 35.F / 32 * r;
    slope_[k] = kernel * (bell(u1) - bell(u2) + bell(u3));
    slope_[k] = (a < 0).select(-slope_[k], slope_[k]) * (n[3] - line * d[3]) * inverse;
  }
}

WindowFitter::Gram WindowFitter::gram_of(int columns) const {
  Gram products(columns, columns);
  gram(J_.data(), padded_, columns, products.data());
  return products;
}

void WindowFitter::solve_amplitudes() {
  thread_local std::vector<std::size_t> mine;
  for (std::size_t f = 0; f < image_.size(); ++f) {
    ex_[f] = ey_[f] = 0;
    while (true) {
      mine.clear();
      for (std::size_t k = 0; k < lit_.size(); ++k) {
        if (lit_[k].on && lit_[k].family == static_cast<int>(f)) mine.push_back(k);
      }
      const auto n = static_cast<int>(mine.size() + 1);
      for (int i = 0; i + 1 < n; ++i)
        J_.col(i) = (root_[f] * profile_[mine[static_cast<std::size_t>(i)]]).matrix();
      J_.col(n - 1) = root_[f].matrix();
      J_.col(n) = (root_[f] * image_[f]).matrix();
      const Gram products = gram_of(n + 1);
      Dense A = products.topLeftCorner(n, n).cast<double>();
      const DenseVector b = products.col(n).head(n).cast<double>();
      for (Eigen::Index i = 0; i < n; ++i) A(i, i) += 1e-4 * A(i, i) + 1e-9;
      const DenseVector c = A.llt().solve(b);
      offset_[f] = static_cast<float>(c[n - 1]);
      Eigen::Index worst = -1;
      for (Eigen::Index i = 0; i + 1 < n; ++i) {
        lit_[mine[static_cast<std::size_t>(i)]].amplitude = static_cast<float>(c[i]);
        if (c[i] < 0.005 && (worst < 0 || c[i] < c[worst])) worst = i;
      }
      if (worst < 0) break;
      lit_[mine[static_cast<std::size_t>(worst)]].on = false;
    }
  }
}

double WindowFitter::step(Quadric& q, bool last, WindowFit& fit) {
  int unknowns = 6;
  std::vector<int> first(image_.size());
  for (std::size_t f = 0; f < image_.size(); ++f) {
    first[f] = unknowns;
    unknowns += 3;
    for (const Lit& lit : lit_) unknowns += lit.on && lit.family == static_cast<int>(f) ? 1 : 0;
  }
  Dense H = Dense::Zero(unknowns, unknowns);
  DenseVector g = DenseVector::Zero(unknowns);
  double chi2 = 0;
  double degrees = 0;
  thread_local Column envelope, sum, geometry, residual;
  // Inverse depth in units of the present one: unknowns of like size.
  const auto unit = static_cast<float>(q[0]);
  for (std::size_t f = 0; f < image_.size(); ++f) {
    envelope = 1.F + ex_[f] * x_ + ey_[f] * y_;
    sum = geometry = Column::Zero(padded_);
    int columns = 6;
    for (std::size_t k = 0; k < lit_.size(); ++k) {
      if (!lit_[k].on || lit_[k].family != static_cast<int>(f)) continue;
      sum += lit_[k].amplitude * profile_[k];
      geometry += lit_[k].amplitude * slope_[k];
      J_.col(columns++) = (root_[f] * envelope * profile_[k]).matrix();
    }
    residual = root_[f] * (image_[f] - offset_[f] - envelope * sum);
    J_.col(columns++) = root_[f].matrix();
    J_.col(columns++) = (root_[f] * x_ * sum).matrix();
    J_.col(columns++) = (root_[f] * y_ * sum).matrix();
    const double rss = static_cast<double>(residual.square().sum());
    variance_[f] = static_cast<float>(rss) / std::max(weight_sum_[f], 1e-6F);
    chi2 += rss * static_cast<double>(inverse_variance_[f]);
    degrees += static_cast<double>(weight_sum_[f]);
    if (columns == 9) {  // no line of this family: it says nothing of depth, only the offset
      for (int i = 0; i < 3; ++i) H(first[f] + i, first[f] + i) = 1;
      continue;
    }
    geometry *= root_[f] * envelope * unit;
    J_.col(0) = geometry.matrix();
    J_.col(1) = (geometry * x_).matrix();
    J_.col(2) = (geometry * y_).matrix();
    J_.col(3) = (geometry * xx_).matrix();
    J_.col(4) = (geometry * xy_).matrix();
    J_.col(5) = (geometry * yy_).matrix();
    J_.col(columns) = residual.matrix();
    const Gram local = gram_of(columns + 1);
    const auto iv = static_cast<double>(inverse_variance_[f]);
    const auto place = [&](int c) { return c < 6 ? c : first[f] + c - 6; };
    for (int i = 0; i < columns; ++i) {
      g[place(i)] += iv * static_cast<double>(local(i, columns));
      for (int j = 0; j < columns; ++j)
        H(place(i), place(j)) += iv * static_cast<double>(local(i, j));
    }
    // A weak prior on the slope of albedo: 0.3 over the window.
    for (int c = columns - 2; c < columns; ++c) {
      const double e = static_cast<double>(c == columns - 2 ? ex_[f] : ey_[f]);
      H(place(c), place(c)) += 11;
      g[place(c)] -= 11 * e;
    }
  }
  // Weak prior on curvature: a bow of so many footprints over the window's half.
  constexpr double kBow = 6;
  const double bow = kBow * q[0];
  for (int c = 3; c < 6; ++c) {
    H(c, c) += 1 / (bow * bow);
    g[c] -= q[c] / q[0] / (bow * bow);
  }
  for (int i = 0; i < unknowns; ++i) H(i, i) *= 1 + 1e-6;
  const Eigen::LLT<Dense> solver(H);
  if (solver.info() != Eigen::Success) return 1e9;
  if (last) {
    fit.misfit = static_cast<float>(chi2 / degrees);
    const double inflate = std::max(1.0, chi2 / degrees);
    // Of the inverse, what is read: the depth's column, and an element for each line.
    std::vector<int> next = first;
    std::vector<int> unknown_of_lit;
    for (const Lit& lit : lit_) {
      if (lit.on) unknown_of_lit.push_back(next[static_cast<std::size_t>(lit.family)]++);
    }
    Dense columns = Dense::Zero(unknowns, 1 + static_cast<Eigen::Index>(unknown_of_lit.size()));
    columns(0, 0) = 1;
    for (std::size_t k = 0; k < unknown_of_lit.size(); ++k)
      columns(unknown_of_lit[k], 1 + static_cast<Eigen::Index>(k)) = 1;
    solver.solveInPlace(columns);
    fit.variance = columns(0, 0) * inflate * q[0] * q[0];
    Eigen::Index k = 0;
    for (Lit& lit : lit_) {
      if (!lit.on) continue;
      const int at = unknown_of_lit[static_cast<std::size_t>(k)];
      lit.amplitude_variance = static_cast<float>(inflate * columns(at, ++k));
    }
    return 0;
  }
  const DenseVector delta = solver.solve(g);
  if (!delta.allFinite()) return 1e9;
  // No step beyond a fraction of a line, within which the profile is well linear.
  double most = 0;
  for (const Lit& lit : lit_) {
    if (!lit.on) continue;
    most = std::max(most, std::abs(delta[0] * q[0] * static_cast<double>(lit.lines.slope(unit))));
  }
  const double limit = most > 0.15 ? 0.15 / most : 1.0;
  const double scale = limit * q[0];
  for (int c = 0; c < 6; ++c) q[c] += scale * delta[c];
  std::vector<int> next = first;
  for (Lit& lit : lit_) {
    if (!lit.on) continue;
    lit.amplitude +=
        static_cast<float>(limit * delta[next[static_cast<std::size_t>(lit.family)]++]);
    if (lit.amplitude < 0.003F) lit.on = false;
  }
  for (std::size_t f = 0; f < image_.size(); ++f) {
    offset_[f] += static_cast<float>(limit * delta[next[f]]);
    ex_[f] += static_cast<float>(limit * delta[next[f] + 1]);
    ey_[f] += static_cast<float>(limit * delta[next[f] + 2]);
    ex_[f] = std::clamp(ex_[f], -0.8F, 0.8F);
    ey_[f] = std::clamp(ey_[f], -0.8F, 0.8F);
  }
  return most;
}

bool WindowFitter::iterate(Quadric& q, int rounds, WindowFit& fit) {
  for (int round = 0; round < rounds; ++round) {
    const double moved = step(q, false, fit);
    if (!(moved < 1e6) || !(q[0] > 0)) return false;
    if (std::none_of(lit_.begin(), lit_.end(), [](const Lit& l) { return l.on; })) return false;
    // The blur follows the slope of the surface.
    const auto w = static_cast<float>(q[0]);
    const auto wx = static_cast<float>(q[1] / half_);
    const auto wy = static_cast<float>(q[2] / half_);
    for (Lit& lit : lit_) {
      const float gradient = lit.lines.gradient(w, wx, wy).norm();
      lit.inverse_reach = 1 / std::clamp(3 * light_->blur_px * gradient, 0.02F, 2.F);
    }
    render(q);
    if (moved < 2e-3) break;
  }
  return true;
}

void WindowFitter::compare_light() {
  seen_ = predicted_ = Column::Zero(padded_);
  thread_local Column light;
  for (std::size_t f = 0; f < image_.size(); ++f) {
    light = Column::Zero(padded_);
    for (std::size_t k = 0; k < lit_.size(); ++k) {
      if (lit_[k].on && lit_[k].family == static_cast<int>(f))
        light += lit_[k].amplitude * profile_[k];
    }
    light *= 1.F + ex_[f] * x_ + ey_[f] * y_;
    seen_ += inverse_variance_[f] * weight_[f] * light * (image_[f] - offset_[f]);
    predicted_ += inverse_variance_[f] * weight_[f] * light.square();
  }
}

std::optional<std::size_t> WindowFitter::dark_side() const {
  std::optional<std::size_t> darkest;
  float least = kLeastLight;
  for (std::size_t side = 0; side < beyond_.size(); ++side) {
    const float energy = (beyond_[side] * predicted_).sum();
    const float seen = (beyond_[side] * seen_).sum();
    if (!(energy > kLeastEnergy && seen < least * energy)) continue;
    least = seen / energy;
    darkest = side;
  }
  return darkest;
}

bool WindowFitter::is_middle_dark() const {
  const float energy = (middle_ * predicted_).sum();
  return energy > kLeastEnergy && (middle_ * seen_).sum() < kLeastLight * energy;
}

std::optional<WindowFit> WindowFitter::fit(const Vec2& pixel, const Quadric& start, int rounds) {
  if (!(start[0] > 0) || !start.allFinite()) return std::nullopt;
  const int u = static_cast<int>(std::lround(pixel[0]));
  const int v = static_cast<int>(std::lround(pixel[1]));
  if (!gather(u, v)) return std::nullopt;
  const Vec2 m = light_->camera->normalized_from_pixel(pixel);
  const Eigen::Matrix2d jacobian = light_->camera->pixel_slope(m).inverse();
  Quadric q = start;
  choose_patterns(m, jacobian, q);
  if (lit_.empty()) return std::nullopt;
  render(q);
  solve_amplitudes();
  WindowFit fit;
  if (!iterate(q, rounds, fit)) return std::nullopt;
  // Where the surface ends within the window, fit what is left of it.
  compare_light();
  if (const auto side = dark_side()) {
    for (std::size_t f = 0; f < image_.size(); ++f)
      set_weight(f, weight_[f] * (1.F - beyond_[*side]));
    choose_patterns(m, jacobian, q);
    if (lit_.empty()) return std::nullopt;
    render(q);
    solve_amplitudes();
    if (!iterate(q, rounds, fit)) return std::nullopt;
    compare_light();
    if (dark_side()) return std::nullopt;
    fit.cut = true;
  }
  // The centre itself must show the light that is predicted there.
  if (is_middle_dark()) return std::nullopt;
  step(q, true, fit);
  fit.q = q;
  float residual = 0;
  for (const Lit& lit : lit_) {
    if (lit.on) fit.amplitude = std::max(fit.amplitude, lit.amplitude);
  }
  for (const Lit& lit : lit_) {
    if (!lit.on || lit.amplitude < kLeastShare * fit.amplitude) continue;
    const float least = least_significance(sampled_share_[static_cast<std::size_t>(lit.family)]);
    if (lit.amplitude < least * std::sqrt(lit.amplitude_variance)) continue;
    fit.lit.set(static_cast<std::size_t>(lit.pattern));
    fit.lines_per_w =
        std::max(fit.lines_per_w, std::abs(lit.lines.slope(static_cast<float>(q[0]))));
  }
  if (fit.lit.none() || !(fit.variance > 0)) return std::nullopt;
  for (const float variance : variance_) residual = std::max(residual, variance);
  fit.relative_residual = std::sqrt(residual) / fit.amplitude;
  return fit;
}

}  // namespace pencilscan
