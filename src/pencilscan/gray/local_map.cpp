#include "pencilscan/gray/local_map.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "pencilscan/core/median.h"
#include "pencilscan/geometry/least_squares.h"

namespace pencilscan {
namespace {

struct Crossing {
  double a = 0, b = 0;  ///< camera px from the centre
  double value = 0;     ///< panel px from the centre's code
};

Vec6 basis(double a, double b) {
  Vec6 f;
  f << 1, a, b, a * a, a * b, b * b;
  return f;
}

/// Those of the direction along which the code changes faster: the other one's lie on the same
/// curves and say the same again.
std::vector<Crossing> crossings_near(const DecodedView& view, std::size_t axis, int u, int v,
                                     int radius) {
  std::vector<Crossing> best;
  const double code = view.code[axis](v, u);
  for (std::size_t direction = 0; direction < 2; ++direction) {
    std::vector<Crossing> found;
    const auto& map = view.crossing[axis][direction];
    for (int y = std::max(v - radius, 0); y <= std::min(v + radius, map.rows - 1); ++y) {
      for (int x = std::max(u - radius, 0); x <= std::min(u + radius, map.cols - 1); ++x) {
        const cv::Vec2f c = map(y, x);
        if (c[0] < 0) continue;
        const double a = x - u + (direction == 0 ? static_cast<double>(c[0]) : 0.0);
        const double b = y - v + (direction == 1 ? static_cast<double>(c[0]) : 0.0);
        if (std::abs(c[1] - code) > 2 + 4 * std::max(std::abs(a), std::abs(b))) continue;
        found.push_back({a, b, c[1] - code});
      }
    }
    if (found.size() > best.size()) best = std::move(found);
  }
  return best;
}

struct AxisFit {
  Vec6 coefficients = Vec6::Zero();
  double sigma = 0;
};

/// Crossings of one edge of the pattern err alike (texture, place within the pixels): the variance
/// of the centre with the residuals of an edge added up first (the "sandwich" of clustered data,
/// Liang and Zeger 1986), for the six degrees of freedom that the fit took.
double variance_by_edges(const std::vector<Crossing>& crossings, const std::vector<double>& weights,
                         const Vec6& coefficients, const Vec6& influence) {
  std::map<double, double> sums;
  for (std::size_t i = 0; i < crossings.size(); ++i) {
    const Vec6 f = basis(crossings[i].a, crossings[i].b);
    sums[crossings[i].value] +=
        weights[i] * influence.dot(f) * (crossings[i].value - coefficients.dot(f));
  }
  double variance = 0;
  for (const auto& [value, sum] : sums) variance += sum * sum;
  // Along the pattern the fit has three parameters.
  const auto edges = static_cast<double>(sums.size());
  return variance * edges / std::max(edges - 3, 1.0);
}

std::optional<AxisFit> fit_axis(const std::vector<Crossing>& crossings, double edge_sigma,
                                const LocalMapOptions& options) {
  if (crossings.size() < static_cast<std::size_t>(options.least_crossings)) return std::nullopt;
  std::vector<double> weights(crossings.size(), 1);
  AxisFit fit;
  double scale = 0;
  Mat6 normal;
  double weight_sum = 0;
  constexpr int kRounds = 4;
  for (int round = 0; round < kRounds; ++round) {
    normal.setZero();
    Vec6 right = Vec6::Zero();
    for (std::size_t i = 0; i < crossings.size(); ++i) {
      const Vec6 f = basis(crossings[i].a, crossings[i].b);
      normal += weights[i] * f * f.transpose();
      right += weights[i] * crossings[i].value * f;
    }
    normal.diagonal().array() += 1e-9;
    fit.coefficients = solve_symmetric(normal, right);
    std::vector<double> residuals(crossings.size());
    for (std::size_t i = 0; i < crossings.size(); ++i)
      residuals[i] = std::abs(crossings[i].value -
                              fit.coefficients.dot(basis(crossings[i].a, crossings[i].b)));
    const double gradient = std::hypot(fit.coefficients[1], fit.coefficients[2]);
    scale = std::max(kDeviationPerMedian * upper_median(residuals),
                     0.5 * edge_sigma * std::max(gradient, 0.2));
    weight_sum = 0;
    for (std::size_t i = 0; i < crossings.size(); ++i) {
      const double t = residuals[i] / (4.685 * scale);  // Tukey: 95 % efficient
      weights[i] = t < 1 ? (1 - t * t) * (1 - t * t) : 0;
      weight_sum += weights[i];
    }
  }
  const auto count = static_cast<double>(crossings.size());
  if (count == 0 || scale > options.worst_rms_px || weight_sum < options.least_inliers * count)
    return std::nullopt;
  const double freedom = std::max(weight_sum - 6, 1.0);
  const Vec6 influence = solve_symmetric(normal, Vec6::Unit(0));
  const double variance = influence[0];
  const double gradient = std::hypot(fit.coefficients[1], fit.coefficients[2]);
  // Few crossings say little about their own scatter: part of the expected one goes in.
  constexpr double kPriorCount = 10;
  const double expected = edge_sigma * std::max(gradient, 0.1);
  const double scatter = std::sqrt((kPriorCount * expected * expected + freedom * scale * scale) /
                                   (kPriorCount + freedom));
  fit.sigma =
      std::sqrt(std::max(scatter * scatter * variance,
                         variance_by_edges(crossings, weights, fit.coefficients, influence)));
  fit.sigma = std::hypot(fit.sigma, options.bias_sigma_px * std::max(gradient, 0.2));
  // One-sided crossings leave the centre to extrapolation.
  if (!(variance < 0.7)) return std::nullopt;
  return fit;
}

}  // namespace

double smooth_share(const DecodedView& view, int step_px, const LocalMapOptions& options) {
  std::size_t smooth = 0;
  std::size_t all = 0;
  for (int v = step_px / 2; v < view.state.rows; v += step_px) {
    for (int u = step_px / 2; u < view.state.cols; u += step_px) {
      if (!view.valid(u, v)) continue;
      ++all;
      smooth += LocalMap::fit(view, u, v, options) ? 1U : 0U;
    }
  }
  return all == 0 ? 0 : static_cast<double>(smooth) / static_cast<double>(all);
}

std::optional<LocalMap> LocalMap::fit(const DecodedView& view, int u, int v,
                                      const LocalMapOptions& options) {
  if (u < 0 || v < 0 || u >= view.state.cols || v >= view.state.rows || !view.valid(u, v))
    return std::nullopt;
  LocalMap map;
  map.center_ = Vec2(u, v);
  for (std::size_t axis = 0; axis < 2; ++axis) {
    std::optional<AxisFit> fit;
    for (int radius = options.radius_px; !fit && radius <= options.largest_radius_px; radius += 2) {
      const auto crossings = crossings_near(view, axis, u, v, radius);
      fit = fit_axis(crossings, options.edge_sigma_px, options);
    }
    if (!fit) return std::nullopt;
    const auto row = static_cast<Eigen::Index>(axis);
    map.coefficients_.row(row) = fit->coefficients.transpose();
    map.coefficients_(row, 0) += view.code[axis](v, u);
    map.sigma_[row] = fit->sigma;
    if (std::abs(fit->coefficients[0]) > 1.5) return std::nullopt;  // not what the code says
  }
  return map;
}

Vec2 LocalMap::panel_from_camera(const Vec2& pixel) const {
  const Vec2 d = pixel - center_;
  return coefficients_ * basis(d.x(), d.y());
}

Eigen::Matrix2d LocalMap::jacobian(const Vec2& pixel) const {
  const Vec2 d = pixel - center_;
  Eigen::Matrix2d result;
  result.col(0) =
      coefficients_.col(1) + 2 * d.x() * coefficients_.col(3) + d.y() * coefficients_.col(4);
  result.col(1) =
      coefficients_.col(2) + d.x() * coefficients_.col(4) + 2 * d.y() * coefficients_.col(5);
  return result;
}

std::optional<Vec2> LocalMap::camera_from_panel(const Vec2& panel, double reach_px) const {
  Vec2 pixel = center_;
  for (int i = 0; i < 8; ++i) {
    const Eigen::Matrix2d J = jacobian(pixel);
    if (std::abs(J.determinant()) < 1e-3) return std::nullopt;
    const Vec2 step = J.inverse() * (panel - panel_from_camera(pixel));
    pixel += step;
    if (!((pixel - center_).norm() <= reach_px)) return std::nullopt;
    if (step.norm() < 1e-6) return pixel;
  }
  return std::nullopt;
}

Eigen::Matrix2d LocalMap::camera_covariance(const Vec2& pixel) const {
  const Eigen::Matrix2d inverse = jacobian(pixel).inverse();
  return inverse * sigma_.cwiseAbs2().asDiagonal() * inverse.transpose();
}

}  // namespace pencilscan
