#include "pencilscan/color/lateral_color.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <tuple>

#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/geometry/least_squares.h"
#include "pencilscan/gray/local_map.h"

namespace pencilscan {
namespace {

constexpr Eigen::Index kPerDevice = 3;  ///< shift x, y; scale - 1

/// One sample's two equations: A_camera p_camera + A_projector p_projector = offset.
struct OffsetEquations {
  Eigen::Index camera = 0;     ///< first unknown
  Eigen::Index projector = 0;  ///< first unknown
  Eigen::Matrix<double, 2, kPerDevice> of_camera;
  Eigen::Matrix<double, 2, kPerDevice> of_projector;
  Vec2 offset;
  Vec2 sigma;
  std::size_t part = 0;  ///< of an image: a ninth, under one projector

  [[nodiscard]] Vec2 predicted(const Eigen::VectorXd& p) const {
    return of_camera * p.segment<kPerDevice>(camera) +
           of_projector * p.segment<kPerDevice>(projector);
  }
  /// Unknowns of both devices for row i, over its deviation.
  [[nodiscard]] Vec6 row(Eigen::Index i) const {
    Vec6 a;
    a << of_camera.row(i).transpose(), of_projector.row(i).transpose();
    return a / sigma[i];
  }
};

Eigen::Matrix<double, 2, kPerDevice> displacement_rows(const Device& device, const Vec2& pixel) {
  Eigen::Matrix<double, 2, kPerDevice> rows;
  rows.leftCols<2>().setIdentity();
  rows.col(2) = pixel - image_center(device);
  return rows;
}

std::vector<OffsetEquations> equations_of(const Rig& rig, std::span<const ColorSample> samples,
                                          std::size_t color, double edge_sigma) {
  std::vector<OffsetEquations> all;
  std::map<std::tuple<std::size_t, std::size_t, int, int>, std::size_t> parts;
  for (const ColorSample& s : samples) {
    if (s.color != color) continue;
    const Camera& camera = rig.cameras[s.camera];
    const Projector& projector = rig.projectors[s.projector];
    OffsetEquations e;
    e.camera = kPerDevice * static_cast<Eigen::Index>(s.camera);
    e.projector = kPerDevice * static_cast<Eigen::Index>(rig.cameras.size() + s.projector);
    e.of_camera = -s.panel_per_camera * displacement_rows(camera, s.camera_pixel);
    e.of_projector = displacement_rows(projector, s.panel_pixel);
    e.offset = s.offset_px;
    e.sigma = (s.sigma_px.array().square() + edge_sigma * edge_sigma).sqrt();
    const auto third = [](double at, int size) { return static_cast<int>(3 * at / size); };
    e.part = parts
                 .try_emplace({s.camera, s.projector, third(s.camera_pixel.x(), camera.width),
                               third(s.camera_pixel.y(), camera.height)},
                              parts.size())
                 .first->second;
    all.push_back(e);
  }
  return all;
}

void add_block(const OffsetEquations& e, const Mat6& block, Eigen::MatrixXd& N) {
  N.block<3, 3>(e.camera, e.camera) += block.topLeftCorner<3, 3>();
  N.block<3, 3>(e.camera, e.projector) += block.topRightCorner<3, 3>();
  N.block<3, 3>(e.projector, e.camera) += block.bottomLeftCorner<3, 3>();
  N.block<3, 3>(e.projector, e.projector) += block.bottomRightCorner<3, 3>();
}

void add_segments(const OffsetEquations& e, const Vec6& v, Eigen::VectorXd& to) {
  to.segment<3>(e.camera) += v.head<3>();
  to.segment<3>(e.projector) += v.tail<3>();
}

struct ColorFit {
  Eigen::VectorXd parameters;
  Eigen::MatrixXd normal;     ///< equations, the prior with them
  std::vector<Vec2> weights;  ///< per equation: of the loss, over the scatter squared
};

/// Tukey's weights (95 % efficient) of what the parameters leave.
void reweigh(const std::vector<OffsetEquations>& equations, ColorFit& fit) {
  const auto left = [&](const OffsetEquations& e) -> Vec2 {
    return (e.offset - e.predicted(fit.parameters)).cwiseQuotient(e.sigma);
  };
  std::vector<double> sizes;
  for (const OffsetEquations& e : equations)
    for (const double z : left(e)) sizes.push_back(std::abs(z));
  const double scale = std::max(kDeviationPerMedian * upper_median(std::move(sizes)), 0.1);
  for (std::size_t i = 0; i < equations.size(); ++i) {
    const Vec2 t = left(equations[i]) / (4.685 * scale);
    for (Eigen::Index k = 0; k < 2; ++k) {
      const double rest = std::max(0.0, 1 - t[k] * t[k]);
      fit.weights[i][k] = rest * rest / (scale * scale);
    }
  }
}

ColorFit fit_color(const std::vector<OffsetEquations>& equations, const Eigen::VectorXd& prior) {
  const Eigen::Index n = prior.size();
  ColorFit fit{Eigen::VectorXd::Zero(n), {}, {}};
  fit.weights.assign(equations.size(), Vec2(1, 1));
  constexpr int kRounds = 6;
  for (int round = 0; round < kRounds; ++round) {
    fit.normal = prior.asDiagonal();
    Eigen::VectorXd right = Eigen::VectorXd::Zero(n);
    for (std::size_t i = 0; i < equations.size(); ++i) {
      const OffsetEquations& e = equations[i];
      Mat6 block = Mat6::Zero();
      Vec6 sum = Vec6::Zero();
      for (Eigen::Index k = 0; k < 2; ++k) {
        const Vec6 a = e.row(k);
        block += fit.weights[i][k] * a * a.transpose();
        sum += fit.weights[i][k] * a * (e.offset[k] / e.sigma[k]);
      }
      add_block(e, block, fit.normal);
      add_segments(e, sum, right);
    }
    fit.parameters = solve_symmetric(fit.normal, Eigen::MatrixXd(right));
    reweigh(equations, fit);
  }
  return fit;
}

/// What one part of an image, or one pair, says of the unknowns: the gradient of the cost, and how
/// an error of one px that all its samples share would change it, per panel axis.
struct SharedError {
  Eigen::VectorXd gradient;
  std::array<Eigen::VectorXd, 2> by_px;

  explicit SharedError(Eigen::Index n)
      : gradient(Eigen::VectorXd::Zero(n)),
        by_px{Eigen::VectorXd::Zero(n), Eigen::VectorXd::Zero(n)} {}
};

/// One standard deviation of every unknown.
Eigen::VectorXd deviations(const std::vector<OffsetEquations>& equations, const ColorFit& fit,
                           const Eigen::VectorXd& prior, double shared_error_px) {
  const Eigen::Index n = prior.size();
  std::map<std::size_t, SharedError> of_parts;
  std::map<std::pair<Eigen::Index, Eigen::Index>, SharedError> of_pairs;
  for (std::size_t i = 0; i < equations.size(); ++i) {
    const OffsetEquations& e = equations[i];
    const Vec2 z = (e.offset - e.predicted(fit.parameters)).cwiseQuotient(e.sigma);
    SharedError& part = of_parts.try_emplace(e.part, n).first->second;
    SharedError& pair = of_pairs.try_emplace({e.camera, e.projector}, n).first->second;
    for (Eigen::Index k = 0; k < 2; ++k) {
      const Vec6 pull = fit.weights[i][k] * e.row(k);
      add_segments(e, pull * z[k], part.gradient);
      add_segments(e, pull / e.sigma[k], part.by_px[static_cast<std::size_t>(k)]);
      add_segments(e, pull / e.sigma[k], pair.by_px[static_cast<std::size_t>(k)]);
    }
  }
  Eigen::MatrixXd scatter = prior.asDiagonal();
  const auto add_shared = [&](const SharedError& shared) {
    for (const Eigen::VectorXd& g : shared.by_px)
      scatter += shared_error_px * shared_error_px * g * g.transpose();
  };
  for (const auto& [key, part] : of_parts) {
    scatter += part.gradient * part.gradient.transpose();
    add_shared(part);
  }
  for (const auto& [key, pair] : of_pairs) add_shared(pair);
  const Eigen::MatrixXd C =
      solve_symmetric(fit.normal, Eigen::MatrixXd(Eigen::MatrixXd::Identity(n, n)));
  const Eigen::MatrixXd clustered = C * scatter * C;
  return C.diagonal().cwiseMax(clustered.diagonal()).cwiseSqrt();
}

double rms(double squares, std::size_t count) {
  return std::sqrt(squares / static_cast<double>(std::max<std::size_t>(count, 1)));
}

}  // namespace

std::vector<ColorSample> color_samples(std::size_t camera, std::size_t projector,
                                       const DecodedView& grey,
                                       const std::array<DecodedView, 3>& channels, int spacing_px) {
  const auto across = static_cast<std::size_t>(grey.state.cols / spacing_px);
  const auto down = static_cast<std::size_t>(grey.state.rows / spacing_px);
  std::vector<std::array<std::optional<ColorSample>, 3>> found(across * down);
  parallel_for(found.size(), [&](std::size_t i) {
    const int u = spacing_px / 2 + spacing_px * static_cast<int>(i % across);
    const int v = spacing_px / 2 + spacing_px * static_cast<int>(i / across);
    const auto all = LocalMap::fit(grey, u, v);
    if (!all) return;
    ColorSample sample;
    sample.camera = camera;
    sample.projector = projector;
    sample.camera_pixel = Vec2(u, v);
    sample.panel_pixel = all->panel_from_camera(sample.camera_pixel);
    for (std::size_t k = 0; k < 3; ++k) {
      const auto one = LocalMap::fit(channels[k], u, v);
      if (!one) continue;
      sample.color = k;
      sample.offset_px = one->panel_from_camera(sample.camera_pixel) - sample.panel_pixel;
      sample.sigma_px = one->sigma_panel_px();
      // The channel shows the surface e beside the pixel: the mean of both ends is exact for what
      // is quadratic between them.
      sample.panel_per_camera =
          (all->jacobian(sample.camera_pixel) + one->jacobian(sample.camera_pixel)) / 2;
      found[i][k] = sample;
    }
  });
  std::vector<ColorSample> samples;
  for (const auto& place : found)
    for (const auto& sample : place)
      if (sample) samples.push_back(*sample);
  return samples;
}

LateralColor estimate_lateral_color(const Rig& rig, std::span<const ColorSample> samples,
                                    const LateralColorOptions& options) {
  LateralColor result;
  if (samples.empty()) return result;
  result.samples = samples.size();
  const std::size_t devices = device_count(rig);
  result.devices.resize(devices);
  Eigen::VectorXd usual(kPerDevice * static_cast<Eigen::Index>(devices));
  for (std::size_t d = 0; d < devices; ++d)
    usual.segment<kPerDevice>(kPerDevice * static_cast<Eigen::Index>(d)) =
        Vec3(options.usual_shift_px, options.usual_shift_px, options.usual_scale);
  const Eigen::VectorXd prior = usual.array().square().inverse();
  double measured = 0;
  double remaining = 0;
  double explained = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto equations = equations_of(rig, samples, k, options.edge_sigma_px);
    const ColorFit fit = fit_color(equations, prior);
    const Eigen::VectorXd sigma = deviations(equations, fit, prior, options.shared_error_px);
    for (std::size_t d = 0; d < devices; ++d) {
      const auto at = kPerDevice * static_cast<Eigen::Index>(d);
      ColorDisplacementEstimate& estimate = result.devices[d][k];
      estimate.value = {fit.parameters.segment<2>(at), 1 + fit.parameters[at + 2]};
      estimate.shift_sigma_px = sigma.segment<2>(at);
      estimate.scale_sigma = sigma[at + 2];
      estimate.is_determined =
          estimate.shift_sigma_px.maxCoeff() < options.determined_share * options.usual_shift_px;
    }
    for (const OffsetEquations& e : equations) {
      const Vec2 predicted = e.predicted(fit.parameters);
      // Wrong codes would hide what the rest says.
      const Vec2 capped = (e.offset - predicted).cwiseMin(1.0).cwiseMax(-1.0);
      measured += (predicted + capped).squaredNorm();
      remaining += capped.squaredNorm();
      explained += predicted.squaredNorm();
    }
  }
  result.offset_rms_px = rms(measured, samples.size());
  result.remaining_rms_px = rms(remaining, samples.size());
  result.explained_rms_px = rms(explained, samples.size());
  return result;
}

}  // namespace pencilscan
