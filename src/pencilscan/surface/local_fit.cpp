#include "pencilscan/surface/local_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "pencilscan/core/chunks.h"
#include "pencilscan/geometry/least_squares.h"
#include "pencilscan/geometry/quadric_moments.h"

namespace pencilscan {
namespace {

struct PlaneFit {
  Vec3 normal = Vec3::Zero();
  Vec3 tangent = Vec3::Zero();
  Vec3 mean = Vec3::Zero();
  bool is_line = true;  ///< the second spread is too small to define a plane
};

PlaneFit fit_plane(std::span<const Vec3> points, std::span<const double> weights) {
  PlaneFit fit;
  double sum = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    fit.mean += weights[i] * points[i];
    sum += weights[i];
  }
  if (sum <= 0) return fit;
  fit.mean /= sum;
  Mat3 covariance = Mat3::Zero();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3 d = points[i] - fit.mean;
    covariance += weights[i] * d * d.transpose();
  }
  Eigen::SelfAdjointEigenSolver<Mat3> solver;
  solver.computeDirect(covariance / sum);
  fit.normal = solver.eigenvectors().col(0);
  fit.tangent = solver.eigenvectors().col(2);
  constexpr double kFlat = 0.02;  // spread across the curve below 14 % of that along it: a line
  fit.is_line = solver.eigenvalues()[1] < kFlat * solver.eigenvalues()[2];
  return fit;
}

/// Towards the camera but perpendicular to a curve.
Vec3 normal_of_curve(const Vec3& tangent, const Vec3& to_camera) {
  const Vec3 across = to_camera - to_camera.dot(tangent) * tangent;
  return across.norm() > 1e-6 ? across.normalized() : to_camera;
}

/// Uncertainty across the surface of a sample whose sigma runs along the camera ray.
double sigma_across(const SurfaceSample& s, const Vec3& normal) {
  constexpr double kGrazing = 0.2;  // keeps grazing views from looking exact
  return s.sigma * std::max(std::abs(s.to_camera.dot(normal)), kGrazing);
}

/// Fits the quadric of one sample; returns false when too few neighbours define it.
bool fit_quadric(std::span<const SurfaceSample> samples, const PointGrid& grid, double radius,
                 SurfaceSample& sample) {
  const Vec3 n = sample.normal;
  const Vec3 e1 = n.unitOrthogonal();
  const Vec3 e2 = n.cross(e1);
  std::array<double, 15> moments{};  // of quadric_moments.h
  Vec6 b = Vec6::Zero();
  double sum_h2 = 0;
  int count = 0;
  const double width2 = 0.25 * radius * radius;  // Gaussian of half the radius
  grid.for_each_within(sample.position, radius, [&](std::size_t j, double d2) {
    const SurfaceSample& q = samples[j];
    if (q.normal.dot(n) < 0.5) return;
    const Vec3 d = (q.position - sample.position) / radius;
    const double x = d.dot(e1);
    const double y = d.dot(e2);
    const double h = d.dot(n);
    if (std::abs(h) > 0.5) return;
    const double sigma = sigma_across(q, n) / radius;
    const double w = std::exp(-0.5 * d2 / width2) / (1e-4 + sigma * sigma);
    const double xx = x * x, xy = x * y, yy = y * y;
    const double wxx = w * xx, wxy = w * xy, wyy = w * yy;
    const std::array<double, 15> terms{w,        w * x,    w * y,    wxx,      wxy,
                                       wyy,      wxx * x,  wxx * y,  wyy * x,  wyy * y,
                                       wxx * xx, wxx * xy, wxx * yy, wyy * xy, wyy * yy};
    for (std::size_t k = 0; k < terms.size(); ++k) moments[k] += terms[k];
    for (int k = 0; k < 6; ++k) b[k] += h * terms[static_cast<std::size_t>(k)];
    sum_h2 += w * h * h;
    ++count;
  });
  if (count < 8) return false;
  const double sum = moments[0];
  Mat6 A = quadric_normal_matrix(moments);
  // A weak pull of the curvature to zero decides where a single curve leaves it open.
  for (int k = 1; k < 6; ++k) A(k, k) += (k < 3 ? 1e-6 : 3e-3) * sum;
  const Vec6 c = solve_symmetric(A, b);
  if (!c.allFinite()) return false;
  const double residual2 = std::max(0.0, sum_h2 - 2 * c.dot(b) + c.dot(A * c)) / sum;
  sample.residual = radius * std::sqrt(residual2);
  sample.position += std::clamp(c[0], -0.25, 0.25) * radius * n;
  sample.normal = (n - c[1] * e1 - c[2] * e2).normalized();
  return true;
}

}  // namespace

std::vector<Vec3> initial_normals(std::span<const SurfaceSample> samples, const PointGrid& grid,
                                  double radius) {
  std::vector<Vec3> normals(samples.size());
  parallel_chunks(samples.size(), [&](std::size_t i) {
    const SurfaceSample& s = samples[i];
    std::vector<Vec3> points;
    std::vector<double> base;
    grid.for_each_within(s.position, radius, [&](std::size_t j, double d2) {
      if (samples[j].camera != s.camera) return;
      points.push_back(samples[j].position);
      base.push_back(std::exp(-2 * d2 / (radius * radius)));
    });
    std::vector<double> weights = base;
    PlaneFit fit = fit_plane(points, weights);
    const double scale = 0.1 * radius;
    for (int round = 0; round < 3 && !fit.is_line; ++round) {
      for (std::size_t k = 0; k < points.size(); ++k) {
        // Planes through the sample itself: what is asked for is the surface that it lies on.
        const double h = (points[k] - s.position).dot(fit.normal) / scale;
        weights[k] = base[k] / (1 + h * h);
      }
      fit = fit_plane(points, weights);
    }
    Vec3 n = fit.is_line ? normal_of_curve(fit.tangent, s.to_camera) : fit.normal;
    if (n.dot(s.to_camera) < 0) n = -n;
    normals[i] = n;
  });
  return normals;
}

void fit_local_surfaces(std::vector<SurfaceSample>& samples, double radius, std::size_t first) {
  constexpr int kRounds = 2;  // the second uses neighbours whose normals have settled
  if (first == samples.size()) return;
  std::vector<Vec3> positions(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) positions[i] = samples[i].position;
  const PointGrid grid(positions, radius);
  for (int round = 0; round < kRounds; ++round) {
    std::vector<SurfaceSample> fitted(samples.begin() + static_cast<std::ptrdiff_t>(first),
                                      samples.end());
    parallel_chunks(fitted.size(),
                    [&](std::size_t i) { fit_quadric(samples, grid, radius, fitted[i]); });
    for (std::size_t i = 0; i < fitted.size(); ++i) {
      if (round + 1 < kRounds) {
        samples[first + i].normal = fitted[i].normal;
      } else {
        samples[first + i] = fitted[i];
      }
    }
  }
}

}  // namespace pencilscan
