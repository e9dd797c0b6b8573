#include "pencilscan/depth/line_blur.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace pencilscan {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kBlurRidge = 1e-6;
constexpr double kLeastHarmonic = 1e-3;  // of the first one's attenuation

/// Of one pattern over the pixels of a window.
struct Lines {
  int family = 0;
  double lines_per_px = 0;
  ArrayXd coordinate;  ///< l
  ArrayXd l_per_w;     ///< dl / dw
  ArrayXd profile;     ///< P
  ArrayXd slope;       ///< dP / dl
  ArrayXd widening;    ///< dP / ds^2, per px^2
};

/// P and its slopes from the series, at variance s2 (lines^2).
void sum_series(double half_width, double s2, Lines& lines) {
  const double turn = 2 * std::numbers::pi;
  const ArrayXd angle = turn * lines.coordinate;
  const ArrayXd c1 = angle.cos();
  const ArrayXd s1 = angle.sin();
  ArrayXd c = c1;
  ArrayXd s = s1;
  lines.profile = ArrayXd::Constant(c1.size(), 2 * half_width);
  lines.slope = ArrayXd::Zero(c1.size());
  lines.widening = ArrayXd::Zero(c1.size());
  const double rate = 0.5 * turn * turn;
  for (int j = 1;; ++j) {
    const double attenuation = std::exp(-rate * j * j * s2);
    if (attenuation < kLeastHarmonic) break;
    const double height =
        2 * std::sin(turn * j * half_width) / (std::numbers::pi * j) * attenuation;
    lines.profile += height * c;
    lines.slope -= height * turn * j * s;
    lines.widening -= height * rate * j * j * c;
    const ArrayXd next = c * c1 - s * s1;
    s = s * c1 + c * s1;
    c = next;
  }
  lines.widening *= lines.lines_per_px * lines.lines_per_px;
}

/// The light of one family: image, weights, unknowns.
struct FamilyWindow {
  ArrayXd image;
  ArrayXd weight;  ///< over the noise's variance
  std::vector<std::size_t> lines;
  VectorXd light;  ///< amplitudes, offset, ex, ey
};

class BlurFitter {
 public:
  BlurFitter(const CameraLight& light, const DepthMap& map, int half)
      : light_(light), map_(map), grid_(half) {
    const auto pixels = static_cast<Index>(grid_.count);
    for (int k = 0; k < 6; ++k)
      monomials_.push_back(
          Eigen::Map<const Eigen::ArrayXf>(grid_.monomial(k), pixels).cast<double>());
    taper_ = Eigen::Map<const Eigen::ArrayXf>(grid_.taper.data(), pixels).cast<double>();
  }

  /// `window`: all lines of one node.
  void measure(std::span<NodeLines> window) {
    for (NodeLines& entry : window)
      entry.blur.deviation_px2 = std::numeric_limits<double>::infinity();
    if (!find_lines(window) || !gather(window.front().node)) return;
    for (FamilyWindow& family : families_) start_light(family);
    solve(window);
  }

 private:
  bool find_lines(std::span<const NodeLines> window) {
    const DepthNode& node = map_.nodes[window.front().node];
    const Vec2 m = light_.camera->normalized_from_pixel(map_.pixel(window.front().node));
    const Eigen::Matrix2d jacobian = light_.camera->pixel_slope(m).inverse();
    const double h = grid_.half;
    const auto of_node = [](float value) { return static_cast<double>(value); };
    w_ = of_node(node.w) +
         h * (of_node(node.wx) * monomials_[1] + of_node(node.wy) * monomials_[2]) +
         0.5 * h * h *
             (of_node(node.wxx) * monomials_[3] + 2 * of_node(node.wxy) * monomials_[4] +
              of_node(node.wyy) * monomials_[5]);
    lines_.clear();
    for (const NodeLines& entry : window) {
      const PatternView& view = light_.patterns[entry.pattern];
      bool ok = false;
      const WindowLines at = view.lines(m, jacobian, of_node(node.w), ok);
      if (!ok || !(entry.blur.variance_px2 > 0)) return false;
      Lines lines;
      lines.family = view.family();
      lines.lines_per_px = 1 / entry.blur.px_per_line;
      const Eigen::Vector4d n = at.n.cast<double>();
      const Eigen::Vector4d d = at.d.cast<double>();
      const ArrayXd under = d[0] + h * (d[1] * monomials_[1] + d[2] * monomials_[2]) + d[3] * w_;
      lines.coordinate =
          (n[0] + h * (n[1] * monomials_[1] + n[2] * monomials_[2]) + n[3] * w_) / under;
      lines.l_per_w = (n[3] - lines.coordinate * d[3]) / under;
      sum_series(static_cast<double>(view.half_width()),
                 entry.blur.variance_px2 * lines.lines_per_px * lines.lines_per_px, lines);
      lines_.push_back(std::move(lines));
    }
    return true;
  }

  bool gather(std::size_t node) {
    const int u = static_cast<int>(map_.pixel(node)[0]);
    const int v = static_cast<int>(map_.pixel(node)[1]);
    const cv::Mat& first = light_.families.front();
    const int half = grid_.half;
    if (u < half || v < half || u + half >= first.cols || v + half >= first.rows) return false;
    families_.resize(light_.families.size());
    for (std::size_t f = 0; f < families_.size(); ++f) {
      FamilyWindow& family = families_[f];
      family.lines.clear();
      for (std::size_t k = 0; k < lines_.size(); ++k) {
        if (lines_[k].family == static_cast<int>(f)) family.lines.push_back(k);
      }
      if (!family.lines.empty() && !gather(f, u, v, family)) return false;
    }
    return true;
  }

  /// False where a pixel is overexposed, or hardly any has a sample.
  bool gather(std::size_t f, int u, int v, FamilyWindow& family) const {
    family.image.resize(grid_.count);
    family.weight = taper_;
    const cv::Mat& has_sample = light_.sampled[f].empty() ? light_.valid : light_.sampled[f];
    for (const WindowGrid::Row& row : grid_.rows) {
      const int column = u + row.least_du;
      const auto* values = light_.families[f].ptr<float>(v + row.dv) + column;
      const auto* valid = light_.valid.ptr<std::uint8_t>(v + row.dv) + column;
      const auto* sampled = has_sample.ptr<std::uint8_t>(v + row.dv) + column;
      for (int i = 0; i < row.pixels; ++i) {
        if (valid[i] == 0) return false;
        family.image[row.first + i] = static_cast<double>(values[i]);
        if (sampled[i] == 0) family.weight[row.first + i] = 0;
      }
    }
    const double weights = family.weight.sum();
    if (!(weights > 0)) return false;
    const double mean = (family.image * family.weight).sum() / weights;
    family.weight /= static_cast<double>(light_.noise[f].variance(static_cast<float>(mean)));
    return true;
  }

  [[nodiscard]] ArrayXd summed(const FamilyWindow& family) const {
    ArrayXd sum = ArrayXd::Zero(grid_.count);
    for (std::size_t i = 0; i < family.lines.size(); ++i)
      sum += family.light[static_cast<Index>(i)] * lines_[family.lines[i]].profile;
    return sum;
  }
  [[nodiscard]] ArrayXd envelope(const FamilyWindow& family) const {
    const auto n = static_cast<Index>(family.lines.size());
    return 1 + family.light[n + 1] * monomials_[1] + family.light[n + 2] * monomials_[2];
  }
  [[nodiscard]] ArrayXd residual(const FamilyWindow& family) const {
    const auto n = static_cast<Index>(family.lines.size());
    return family.image - family.light[n] - envelope(family) * summed(family);
  }
  /// Columns of amplitudes, offset, ex and ey from `first` on.
  void light_columns(const FamilyWindow& family, Index first, MatrixXd& J) const {
    const ArrayXd around = envelope(family);
    const ArrayXd sum = summed(family);
    auto column = first;
    for (const std::size_t k : family.lines) J.col(column++) = around * lines_[k].profile;
    J.col(column++).setOnes();
    J.col(column++) = monomials_[1] * sum;
    J.col(column) = monomials_[2] * sum;
  }

  /// Amplitudes, offset and slopes for the surface and blur as they are.
  void start_light(FamilyWindow& family) const {
    if (family.lines.empty()) return;
    const auto n = static_cast<Index>(family.lines.size()) + 3;
    family.light = VectorXd::Zero(n);
    for (int round = 0; round < 2; ++round) {  // the first leaves the slopes at 0
      MatrixXd J(grid_.count, n);
      light_columns(family, 0, J);
      MatrixXd A = J.transpose() * family.weight.matrix().asDiagonal() * J;
      VectorXd b = J.transpose() * (family.weight * residual(family)).matrix();
      A.diagonal().tail<2>().array() += kTiltPrecision;
      b.tail<2>() -= kTiltPrecision * family.light.tail<2>();
      A.diagonal() *= 1 + kBlurRidge;
      family.light += A.ldlt().solve(b);
    }
  }

  void solve(std::span<NodeLines> window) const {
    Index unknowns = kSurface;
    for (const FamilyWindow& family : families_) {
      if (!family.lines.empty()) unknowns += static_cast<Index>(family.lines.size()) + 3;
    }
    const Index first_blur = unknowns;
    unknowns += static_cast<Index>(lines_.size());
    MatrixXd A = MatrixXd::Zero(unknowns, unknowns);
    VectorXd b = VectorXd::Zero(unknowns);
    double chi2 = 0;
    double degrees = 0;
    Index at = kSurface;
    for (const FamilyWindow& family : families_) {
      if (family.lines.empty()) continue;
      const auto n = static_cast<Index>(family.lines.size());
      // Columns of this family alone, and where its unknowns are among all.
      MatrixXd J(grid_.count, kSurface + 2 * n + 3);
      std::vector<Index> place;
      for (Index k = 0; k < kSurface; ++k) place.push_back(k);
      for (Index k = 0; k < n + 3; ++k) place.push_back(at + k);
      surface_columns(family, static_cast<double>(map_.nodes[window.front().node].w), J);
      light_columns(family, kSurface, J);
      const ArrayXd around = envelope(family);
      for (Index i = 0; i < n; ++i) {
        const std::size_t k = family.lines[static_cast<std::size_t>(i)];
        J.col(kSurface + n + 3 + i) = family.light[i] * around * lines_[k].widening;
        place.push_back(first_blur + static_cast<Index>(k));
      }
      const ArrayXd rest = residual(family);
      const MatrixXd weighted = family.weight.matrix().asDiagonal() * J;
      A(place, place) += J.transpose() * weighted;
      b(place) += weighted.transpose() * rest.matrix();
      A.diagonal().segment<2>(at + n + 1).array() += kTiltPrecision;
      b.segment<2>(at + n + 1) -= kTiltPrecision * family.light.tail<2>();
      chi2 += (family.weight * rest.square()).sum();
      degrees += (taper_ * (family.weight > 0).cast<double>()).sum();
      at += n + 3;
    }
    A.diagonal() *= 1 + kBlurRidge;
    const Eigen::LDLT<MatrixXd> solver(A);
    const VectorXd x = solver.solve(b);
    const double inflate = std::max(1.0, chi2 / degrees);
    for (std::size_t k = 0; k < lines_.size(); ++k) {
      const Index row = first_blur + static_cast<Index>(k);
      const double variance = inflate * solver.solve(VectorXd::Unit(unknowns, row))[row];
      if (!(variance > 0) || !std::isfinite(x[row])) continue;
      window[k].blur.variance_px2 += x[row];
      window[k].blur.deviation_px2 = std::sqrt(variance);
    }
  }

  /// Of inverse depth in units of `unit`: a quadric.
  void surface_columns(const FamilyWindow& family, double unit, MatrixXd& J) const {
    ArrayXd depth = ArrayXd::Zero(grid_.count);
    for (std::size_t i = 0; i < family.lines.size(); ++i) {
      const Lines& lines = lines_[family.lines[i]];
      depth += family.light[static_cast<Index>(i)] * lines.slope * lines.l_per_w;
    }
    depth *= unit * envelope(family);
    for (Index k = 0; k < kSurface; ++k) J.col(k) = depth * monomials_[static_cast<std::size_t>(k)];
  }

  static constexpr Index kSurface = 6;

  const CameraLight& light_;
  const DepthMap& map_;
  WindowGrid grid_;
  std::vector<ArrayXd> monomials_;  ///< up to degree 2
  ArrayXd taper_;
  ArrayXd w_;
  std::vector<Lines> lines_;  ///< of the window's patterns
  std::vector<FamilyWindow> families_;
};

}  // namespace

void measure_blurs(const CameraLight& light, const DepthMap& map, int half,
                   std::span<NodeLines> lines) {
  BlurFitter fitter(light, map, half);
  for (std::size_t first = 0; first < lines.size();) {
    std::size_t end = first + 1;
    while (end < lines.size() && lines[end].node == lines[first].node) ++end;
    fitter.measure(lines.subspan(first, end - first));
    first = end;
  }
}

}  // namespace pencilscan
