#include "pencilscan/depth/line_blur.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "pencilscan/depth/family_equations.h"

namespace pencilscan {
namespace {

constexpr double kBlurRidge = 1e-6;

/// Of one pattern over the pixels of a window.
struct BlurredLines {
  int family = 0;
  std::vector<float> profile;   ///< P
  std::vector<float> slope;     ///< dP / dw
  std::vector<float> widening;  ///< dP / ds^2, per px^2; then times the amplitude
};

/// One family of a window: what the image shows, and its light. Its patterns are those of
/// `lines`, then what their blur adds, whose amplitude is 0.
struct BlurFamily {
  std::vector<std::size_t> lines;
  std::vector<float> image, root;
  double weights = 0;
  double certainty = 0;  ///< 1 / variance of the noise
  FamilyLight light;
};

class BlurFitter {
 public:
  BlurFitter(const CameraLight& light, const DepthMap& map, int half)
      : light_(light), map_(map), grid_(half), equations_of_(grid_, 2 * light.patterns.size()) {
    w_.assign(grid_.padded, 0.F);
    lines_.resize(light.patterns.size());
    for (BlurredLines& lines : lines_) lines.profile = lines.slope = lines.widening = w_;
    families_.resize(light.families.size());
    for (BlurFamily& family : families_) {
      family.image = family.root = w_;
      family.light.profile.resize(2 * lines_.size());
      family.light.slope.resize(2 * lines_.size());
      family.light.amplitude.resize(2 * lines_.size());
    }
  }
  BlurFitter(const BlurFitter&) = delete;  // its equations point to its grid
  BlurFitter& operator=(const BlurFitter&) = delete;

  /// `window`: all lines of one node.
  void measure(std::span<NodeLines> window) {
    for (NodeLines& entry : window)
      entry.blur.deviation_px2 = std::numeric_limits<double>::infinity();
    if (!find_lines(window) || !gather(window)) return;
    for (BlurFamily& family : families_) start_light(family);
    solve(window);
  }

 private:
  [[nodiscard]] bool find_lines(std::span<const NodeLines> window) {
    const DepthNode& node = map_.nodes[window.front().node];
    const Vec2 m = light_.camera->normalized_from_pixel(map_.pixel(window.front().node));
    const Eigen::Matrix2d jacobian = light_.camera->pixel_slope(m).inverse();
    const auto h = static_cast<float>(grid_.half);
    const float q[6] = {node.w,           h * node.wx,
                        h * node.wy,      0.5F * h * h * node.wxx,
                        h * h * node.wxy, 0.5F * h * h * node.wyy};
    for (std::size_t i = 0; i < grid_.padded; ++i) {
      w_[i] = q[0];
      for (int k = 1; k < 6; ++k) w_[i] += q[k] * grid_.monomial(k)[i];
    }
    for (std::size_t k = 0; k < window.size(); ++k) {
      const PatternView& view = light_.patterns[window[k].pattern];
      const LineBlur& blur = window[k].blur;
      bool ok = false;
      const WindowLines at = view.lines(m, jacobian, static_cast<double>(node.w), ok);
      if (!ok || !(blur.variance_px2 > 0)) return false;
      BlurredLines& lines = lines_[k];
      lines.family = view.family();
      const WindowLineShape shape{{at.n[0], h * at.n[1], h * at.n[2], at.n[3]},
                                  {at.d[0], h * at.d[1], h * at.d[2], at.d[3]},
                                  view.half_width(),
                                  0};
      const double per_px2 = 1 / (blur.px_per_line * blur.px_per_line);
      render_gaussian_lines(grid_, shape, static_cast<float>(blur.variance_px2 * per_px2),
                            w_.data(), lines.profile.data(), lines.slope.data(),
                            lines.widening.data());
      for (float& value : lines.widening) value *= static_cast<float>(per_px2);
    }
    return true;
  }

  [[nodiscard]] bool gather(std::span<const NodeLines> window) {
    const Vec2 pixel = map_.pixel(window.front().node);
    const int u = static_cast<int>(pixel[0]);
    const int v = static_cast<int>(pixel[1]);
    const cv::Mat& first = light_.families.front();
    const int half = grid_.half;
    if (u < half || v < half || u + half >= first.cols || v + half >= first.rows) return false;
    for (std::size_t f = 0; f < families_.size(); ++f) {
      BlurFamily& family = families_[f];
      family.lines.clear();
      for (std::size_t k = 0; k < window.size(); ++k) {
        if (lines_[k].family == static_cast<int>(f)) family.lines.push_back(k);
      }
      if (!family.lines.empty() && !gather(f, u, v, family)) return false;
    }
    return true;
  }

  /// False where a pixel is overexposed, or none has a sample.
  [[nodiscard]] bool gather(std::size_t f, int u, int v, BlurFamily& family) const {
    const cv::Mat& has_sample = light_.sampled[f].empty() ? light_.valid : light_.sampled[f];
    double weights = 0;
    double sum = 0;
    for (const WindowGrid::Row& row : grid_.rows) {
      const int column = u + row.least_du;
      const auto* values = light_.families[f].ptr<float>(v + row.dv) + column;
      const auto* valid = light_.valid.ptr<std::uint8_t>(v + row.dv) + column;
      const auto* sampled = has_sample.ptr<std::uint8_t>(v + row.dv) + column;
      for (int i = 0; i < row.pixels; ++i) {
        if (valid[i] == 0) return false;
        const auto at = static_cast<std::size_t>(row.first + i);
        const float weight = sampled[i] == 0 ? 0.F : grid_.taper[at];
        family.image[at] = values[i];
        family.root[at] = std::sqrt(weight);
        weights += static_cast<double>(weight);
        sum += static_cast<double>(weight * values[i]);
      }
    }
    if (!(weights > 0)) return false;
    family.weights = weights;
    const auto mean = static_cast<float>(sum / weights);
    family.certainty = 1 / static_cast<double>(light_.noise[f].variance(mean));
    return true;
  }

  /// Its light has the profiles of the family's lines, or also what their blur adds.
  void collect(bool with_blur, BlurFamily& family) {
    const std::size_t n = family.lines.size();
    family.light.patterns = static_cast<int>(with_blur ? 2 * n : n);
    for (std::size_t i = 0; i < n; ++i) {
      BlurredLines& lines = lines_[family.lines[i]];
      family.light.profile[i] = lines.profile.data();
      family.light.slope[i] = lines.slope.data();
      if (!with_blur) continue;
      for (float& value : lines.widening) value *= family.light.amplitude[i];
      family.light.profile[n + i] = lines.widening.data();
      family.light.slope[n + i] = lines.slope.data();
      family.light.amplitude[n + i] = 0;
    }
  }

  /// Amplitudes, offset and slopes for the surface and blur as they are.
  void start_light(BlurFamily& family) {
    if (family.lines.empty()) return;
    FamilyLight& light = family.light;
    collect(false, family);
    std::fill(light.amplitude.begin(), light.amplitude.end(), 0.F);
    light.offset = light.ex = light.ey = 0;
    const int n = light.patterns + 3;
    thread_local Eigen::MatrixXd A;
    thread_local Eigen::VectorXd b;
    for (int round = 0; round < 2; ++round) {  // the first leaves the slopes at 0
      equations_of_.sum(light, family.image.data(), family.root.data(), 1);
      A.resize(n, n);
      b.resize(n);
      for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j) A(i, j) = family.certainty * equations_of_.product(i, j);
        b[i] = family.certainty * equations_of_.product(i, n);
      }
      A.diagonal().tail<2>().array() += kTiltPrecision;
      b[n - 2] -= kTiltPrecision * static_cast<double>(light.ex);
      b[n - 1] -= kTiltPrecision * static_cast<double>(light.ey);
      A.diagonal() *= 1 + kBlurRidge;
      A.llt().solveInPlace(b);
      for (int i = 0; i < light.patterns; ++i)
        light.amplitude[static_cast<std::size_t>(i)] += static_cast<float>(b[i]);
      light.offset += static_cast<float>(b[n - 3]);
      light.ex += static_cast<float>(b[n - 2]);
      light.ey += static_cast<float>(b[n - 1]);
    }
  }

  void solve(std::span<NodeLines> window) {
    equations_.reset(families_.size());
    const auto unit = static_cast<double>(map_.nodes[window.front().node].w);
    double chi2 = 0;
    double degrees = 0;
    for (std::size_t f = 0; f < families_.size(); ++f) {
      BlurFamily& family = families_[f];
      if (family.lines.empty()) continue;
      collect(true, family);
      equations_of_.sum(family.light, family.image.data(), family.root.data(),
                        static_cast<float>(unit));
      equations_of_.add(family.light, family.certainty, f, equations_);
      const int residual = FamilyColumns::residual(family.light.patterns);
      chi2 += family.certainty * equations_of_.product(residual, residual);
      degrees += family.weights;
    }
    if (!equations_.eliminate(kBlurRidge)) return;
    const WindowEquations::Surface surface = equations_.solve_surface();
    const double inflate = std::max(1.0, chi2 / degrees);
    for (std::size_t f = 0; f < families_.size(); ++f) {
      const BlurFamily& family = families_[f];
      const std::size_t n = family.lines.size();
      if (n == 0) continue;
      equations_.solve_light(f, surface, change_);
      for (std::size_t i = 0; i < n; ++i) {
        const double variance = inflate * equations_.light_variance(f, static_cast<int>(n + i));
        if (!(variance > 0) || !std::isfinite(change_[n + i])) continue;
        LineBlur& blur = window[family.lines[i]].blur;
        blur.variance_px2 += change_[n + i];
        blur.deviation_px2 = std::sqrt(variance);
      }
    }
  }

  const CameraLight& light_;
  const DepthMap& map_;
  WindowGrid grid_;
  FamilyEquations equations_of_;
  WindowEquations equations_;
  std::vector<float> w_;
  std::vector<BlurredLines> lines_;  ///< of the window's patterns
  std::vector<BlurFamily> families_;
  std::vector<double> change_;
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
