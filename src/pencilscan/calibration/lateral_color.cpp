#include "pencilscan/calibration/lateral_color.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <tuple>

#include "pencilscan/calibration/local_map.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/geometry/least_squares.h"

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
  std::size_t cluster = 0;

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
  std::map<std::tuple<std::size_t, std::size_t, int, int>, std::size_t> clusters;
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
    e.cluster = clusters
                    .try_emplace({s.camera, s.projector, third(s.camera_pixel.x(), camera.width),
                                  third(s.camera_pixel.y(), camera.height)},
                                 clusters.size())
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
  Eigen::VectorXd sigma;
};

ColorFit fit_color(const std::vector<OffsetEquations>& equations, const Eigen::VectorXd& usual) {
  const Eigen::Index n = usual.size();
  const Eigen::VectorXd prior = usual.array().square().inverse();
  ColorFit fit{Eigen::VectorXd::Zero(n), usual};
  std::vector<Vec2> weights(equations.size(), Vec2(1, 1));
  Eigen::MatrixXd N;
  double scale = 1;
  constexpr int kRounds = 6;
  for (int round = 0; round < kRounds; ++round) {
    N = prior.asDiagonal();
    Eigen::VectorXd right = Eigen::VectorXd::Zero(n);
    for (std::size_t i = 0; i < equations.size(); ++i) {
      const OffsetEquations& e = equations[i];
      Mat6 block = Mat6::Zero();
      Vec6 sum = Vec6::Zero();
      for (Eigen::Index k = 0; k < 2; ++k) {
        const Vec6 a = e.row(k);
        const double weight = weights[i][k] / (scale * scale);
        block += weight * a * a.transpose();
        sum += weight * a * (e.offset[k] / e.sigma[k]);
      }
      add_block(e, block, N);
      add_segments(e, sum, right);
    }
    fit.parameters = solve_symmetric(N, Eigen::MatrixXd(right));
    std::vector<double> sizes;
    for (const OffsetEquations& e : equations) {
      const Vec2 z = (e.offset - e.predicted(fit.parameters)).cwiseQuotient(e.sigma);
      sizes.push_back(std::abs(z.x()));
      sizes.push_back(std::abs(z.y()));
    }
    scale = std::max(kDeviationPerMedian * upper_median(sizes), 0.1);
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      const double t = sizes[i] / (4.685 * scale);  // Tukey: 95 % efficient
      weights[i / 2][static_cast<Eigen::Index>(i % 2)] = t < 1 ? (1 - t * t) * (1 - t * t) : 0;
    }
  }
  // Gradients of the cost, added up over each part of an image.
  std::map<std::size_t, Eigen::VectorXd> gradients;
  for (std::size_t i = 0; i < equations.size(); ++i) {
    const OffsetEquations& e = equations[i];
    const Vec2 z = (e.offset - e.predicted(fit.parameters)).cwiseQuotient(e.sigma);
    Vec6 sum = Vec6::Zero();
    for (Eigen::Index k = 0; k < 2; ++k) sum += weights[i][k] / (scale * scale) * z[k] * e.row(k);
    auto [at, is_new] = gradients.try_emplace(e.cluster);
    if (is_new) at->second = Eigen::VectorXd::Zero(n);
    add_segments(e, sum, at->second);
  }
  const Eigen::MatrixXd C = solve_symmetric(N, Eigen::MatrixXd(Eigen::MatrixXd::Identity(n, n)));
  Eigen::MatrixXd scatter = prior.asDiagonal();
  for (const auto& [cluster, g] : gradients) scatter += g * g.transpose();
  const Eigen::MatrixXd clustered = C * scatter * C;
  fit.sigma = C.diagonal().cwiseMax(clustered.diagonal()).cwiseSqrt();
  return fit;
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
    sample.panel_per_camera = all->jacobian(sample.camera_pixel);
    for (std::size_t k = 0; k < 3; ++k) {
      const auto one = LocalMap::fit(channels[k], u, v);
      if (!one) continue;
      sample.color = k;
      sample.offset_px = one->panel_from_camera(sample.camera_pixel) - sample.panel_pixel;
      sample.sigma_px = one->sigma_panel_px();
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
  double measured = 0;
  double remaining = 0;
  double explained = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto equations = equations_of(rig, samples, k, options.edge_sigma_px);
    const ColorFit fit = fit_color(equations, usual);
    for (std::size_t d = 0; d < devices; ++d) {
      const auto at = kPerDevice * static_cast<Eigen::Index>(d);
      ColorDisplacementEstimate& estimate = result.devices[d][k];
      estimate.value = {fit.parameters.segment<2>(at), 1 + fit.parameters[at + 2]};
      const double shared = options.shared_error_px;
      const Vec2 quarter = image_center(device_at(rig, d)) / 2;
      estimate.shift_sigma_px =
          Vec2(std::hypot(fit.sigma[at], shared), std::hypot(fit.sigma[at + 1], shared));
      estimate.scale_sigma = std::hypot(fit.sigma[at + 2], shared / quarter.norm());
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
