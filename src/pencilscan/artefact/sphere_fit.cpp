#include "pencilscan/artefact/sphere_fit.h"

#include <Eigen/LU>
#include <cmath>

#include "pencilscan/geometry/least_squares.h"

namespace pencilscan {
namespace {

/// Gauss-Newton has converged when a step is below this share of the radius: far below what a
/// double resolves of the points, which are floats.
constexpr double kConverged = 1e-12;
constexpr int kMostSteps = 100;
/// Steps below this share of the radius are taken whole: the sum of squares, of which rounding
/// leaves some twelve digits, no longer tells better from worse.
constexpr double kCloseBy = 1e-5;
constexpr int kMostHalvings = 40;
/// Of the smallest eigenvalue to the largest in the normal equations: below, the points lie in a
/// plane as far as floats tell, or on a spot so small that it bends by less than they resolve.
constexpr double kSingular = 1e-13;

double sum_of_squares(std::span<const Vec3> points, const Sphere& sphere) {
  double sum = 0;
  for (const Vec3& point : points) {
    const double r = signed_distance(sphere, point);
    sum += r * r;
  }
  return sum;
}

/// The step (dc, dR) of the normal equations; nothing where they are singular.
std::optional<Eigen::Vector4d> gauss_newton_step(std::span<const Vec3> points, const Sphere& sphere,
                                                 bool free_radius) {
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  for (const Vec3& point : points) {
    const Vec3 difference = point - sphere.center;
    const double distance = difference.norm();
    if (distance == 0) continue;  // its direction says nothing
    Eigen::Vector4d row;
    row << difference / distance, 1;
    normal += row * row.transpose();
    right += (distance - sphere.radius) * row;
  }
  const int unknowns = free_radius ? 4 : 3;
  const Eigen::MatrixXd used = normal.topLeftCorner(unknowns, unknowns);
  const SymmetricEigen eigen = symmetric_eigen(used);
  if (!(eigen.values(0) > kSingular * eigen.values(unknowns - 1))) return std::nullopt;
  const Eigen::MatrixXd along = eigen.vectors.transpose() * right.head(unknowns);
  Eigen::Vector4d step = Eigen::Vector4d::Zero();
  step.head(unknowns) = eigen.vectors * (along.array() / eigen.values.array()).matrix();
  return step;
}

}  // namespace

std::optional<Sphere> fit_sphere(std::span<const Vec3> points, const Sphere& start,
                                 std::optional<double> radius) {
  const bool free_radius = !radius.has_value();
  if (points.size() < (free_radius ? 4U : 3U)) return std::nullopt;
  Sphere sphere{start.center, radius.value_or(start.radius)};
  double sum = sum_of_squares(points, sphere);
  for (int iteration = 0; iteration < kMostSteps; ++iteration) {
    const auto step = gauss_newton_step(points, sphere, free_radius);
    if (!step) return std::nullopt;
    double length = 1;
    bool better = false;
    Sphere next;
    for (int halving = 0; halving < kMostHalvings && !better; ++halving, length /= 2) {
      next = {sphere.center + length * step->head<3>(), sphere.radius + length * (*step)(3)};
      const double next_sum = sum_of_squares(points, next);
      const bool close_by = step->norm() <= kCloseBy * sphere.radius;
      better = next.radius > 0 && (close_by || next_sum <= sum);
      if (better) sum = next_sum;
    }
    if (!better) break;  // at the bottom, as far as doubles tell
    const double moved =
        (next.center - sphere.center).norm() + std::abs(next.radius - sphere.radius);
    sphere = next;
    if (moved <= kConverged * sphere.radius) break;
  }
  if (!sphere.center.allFinite() || !std::isfinite(sphere.radius)) return std::nullopt;
  return sphere;
}

std::optional<Sphere> sphere_through(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  // |p - c|^2 = R^2 for all four; minus the same of a: 2 (p - a)' (c - a) = |p - a|^2.
  Mat3 differences;
  differences << (b - a).transpose(), (c - a).transpose(), (d - a).transpose();
  const Vec3 squares(differences.row(0).squaredNorm(), differences.row(1).squaredNorm(),
                     differences.row(2).squaredNorm());
  const Eigen::FullPivLU<Mat3> lu(differences);
  if (!lu.isInvertible()) return std::nullopt;
  const Vec3 center = 0.5 * lu.solve(squares);
  if (!center.allFinite()) return std::nullopt;
  return Sphere{a + center, center.norm()};
}

}  // namespace pencilscan
