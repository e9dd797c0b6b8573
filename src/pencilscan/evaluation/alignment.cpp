#include "pencilscan/evaluation/alignment.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "pencilscan/core/check.h"
#include "pencilscan/core/chunks.h"
#include "pencilscan/core/evenly_picked.h"
#include "pencilscan/core/median.h"
#include "pencilscan/evaluation/statistics.h"
#include "pencilscan/evaluation/surface_figures.h"
#include "pencilscan/geometry/least_squares.h"

namespace pencilscan {
namespace {

struct Match {
  Vec3 moved = Vec3::Zero();
  Vec3 target = Vec3::Zero();
  Vec3 normal = Vec3::Zero();
  double distance = 0;
};

std::vector<Match> match(std::span<const Vec3> points, const RayScene& truth,
                         const Similarity& pose) {
  std::vector<Match> matches(points.size());
  parallel_chunks(points.size(), [&](std::size_t i) {
    const Vec3 moved = pose * points[i];
    const auto closest = truth.closest_point(moved);
    if (!closest) return;
    matches[i] = {moved, closest->point, face_normal(truth.mesh(), closest->face),
                  closest->distance};
  });
  return matches;
}

double median_distance(const std::vector<Match>& matches) {
  std::vector<double> distances;
  distances.reserve(matches.size());
  for (const Match& m : matches) distances.push_back(m.distance);
  return quantile(std::move(distances), 0.5);
}

/// Tukey's biweight; 0 beyond the cut.
double weight(double residual, double cut) {
  const double r = residual / cut;
  return std::abs(r) < 1 ? (1 - r * r) * (1 - r * r) : 0;
}

Similarity small_motion(const Vec3& rotation, double growth, const Vec3& shift, const Vec3& about) {
  Similarity s;
  s.scale = 1 + growth;
  const double angle = rotation.norm();
  if (angle > 0) s.rotation = Eigen::AngleAxisd(angle, rotation / angle).toRotationMatrix();
  s.translation = about + shift - s.scale * (s.rotation * about);
  return s;
}

Similarity compose(const Similarity& c_from_b, const Similarity& b_from_a) {
  Similarity product;
  product.scale = c_from_b.scale * b_from_a.scale;
  // Kept a rotation over many products.
  const Eigen::Quaterniond q(Mat3(c_from_b.rotation * b_from_a.rotation));
  product.rotation = q.normalized().toRotationMatrix();
  product.translation = c_from_b * b_from_a.translation;
  return product;
}

/// One step of point-to-plane alignment.
Similarity plane_step(const std::vector<Match>& matches, AlignmentKind kind, double size_mm) {
  using Vector7 = Eigen::Matrix<double, 7, 1>;
  // Never below float resolution, so that a perfect fit does not reweight noise of 1e-6 mm.
  const double cut =
      std::max(4.685 * kDeviationPerMedian * median_distance(matches), 1e-7 * size_mm);
  Vec3 center = Vec3::Zero();
  double total = 0;
  for (const Match& m : matches) {
    const double w = weight(m.distance, cut);
    center += w * m.moved;
    total += w;
  }
  if (!(total > 0)) return {};
  center /= total;
  Eigen::Matrix<double, 7, 7> hessian = Eigen::Matrix<double, 7, 7>::Zero();
  Vector7 gradient = Vector7::Zero();
  for (const Match& m : matches) {
    const double w = weight(m.distance, cut);
    if (w == 0) continue;
    const Vec3 arm = (m.moved - center) / size_mm;  // radians and growth in units of the size
    Vector7 row;
    row << arm.cross(m.normal), m.normal,
        kind == AlignmentKind::kSimilarity ? arm.dot(m.normal) : 0.0;
    hessian += w * row * row.transpose();
    gradient += w * row * m.normal.dot(m.target - m.moved);
  }
  // A little damping: what the surface leaves free (a sphere's rotation) stays as it is.
  hessian.diagonal().array() += 1e-9 * total;
  const Vector7 step = hessian.ldlt().solve(gradient);
  const double growth = kind == AlignmentKind::kSimilarity ? step[6] / size_mm : 0.0;
  return small_motion(step.head<3>() / size_mm, std::clamp(growth, -0.3, 0.3), step.segment<3>(3),
                      center);
}

/// One step of point-to-point alignment, by Umeyama's closed form.
Similarity point_step(const std::vector<Match>& matches, AlignmentKind kind) {
  const double cut = 4.685 * kDeviationPerMedian * median_distance(matches);
  std::vector<const Match*> kept;
  for (const Match& m : matches) {
    if (m.distance <= cut) kept.push_back(&m);
  }
  if (kept.size() < 3) return {};
  Eigen::Matrix3Xd from(3, kept.size());
  Eigen::Matrix3Xd to(3, kept.size());
  for (std::size_t i = 0; i < kept.size(); ++i) {
    from.col(static_cast<Eigen::Index>(i)) = kept[i]->moved;
    to.col(static_cast<Eigen::Index>(i)) = kept[i]->target;
  }
  const Eigen::Matrix4d t = fit_similarity(from, to, kind == AlignmentKind::kSimilarity);
  Similarity s;
  s.scale = kind == AlignmentKind::kSimilarity ? t.col(0).head<3>().norm() : 1.0;
  if (!(s.scale > 0) || !t.allFinite()) return {};
  s.rotation = t.topLeftCorner<3, 3>() / s.scale;
  s.translation = t.topRightCorner<3, 1>();
  return s;
}

AlignmentReport refine(std::span<const Vec3> points, const RayScene& truth, AlignmentKind kind,
                       const Similarity& start, int point_steps, int max_iterations,
                       double size_mm) {
  AlignmentReport report;
  report.truth_from_result = start;
  for (; report.iterations < max_iterations; ++report.iterations) {
    const auto matches = match(points, truth, report.truth_from_result);
    const Similarity step = report.iterations < point_steps ? point_step(matches, kind)
                                                            : plane_step(matches, kind, size_mm);
    report.truth_from_result = compose(step, report.truth_from_result);
    double moved = 0;
    for (const Match& m : matches) moved = std::max(moved, (step * m.moved - m.moved).norm());
    if (report.iterations >= point_steps && moved < 1e-7 * size_mm) break;
  }
  report.median_mm = median_distance(match(points, truth, report.truth_from_result));
  return report;
}

struct Spread {
  Vec3 center = Vec3::Zero();
  Mat3 axes = Mat3::Identity();  ///< principal axes as columns, right-handed
  double size = 1;               ///< root mean square distance from the centre
};

Spread spread_of(std::span<const Vec3> points) {
  Spread spread;
  for (const Vec3& p : points) spread.center += p;
  spread.center /= static_cast<double>(points.size());
  Mat3 covariance = Mat3::Zero();
  for (const Vec3& p : points) {
    covariance += (p - spread.center) * (p - spread.center).transpose();
  }
  covariance /= static_cast<double>(points.size());
  spread.size = std::sqrt(covariance.trace());
  spread.axes = Eigen::SelfAdjointEigenSolver<Mat3>(covariance).eigenvectors();
  if (spread.axes.determinant() < 0) spread.axes.col(0) *= -1;
  return spread;
}

/// Poses that match centroid and size of the two, unturned and turned by the principal axes.
std::vector<Similarity> coarse_poses(std::span<const Vec3> points, const RayScene& truth,
                                     AlignmentKind kind) {
  constexpr std::size_t kSamples = 5000;
  std::vector<Vec3> surface;
  for (const auto& s : sample_surface(truth.mesh(), kSamples, 1)) surface.push_back(s.point);
  const Spread from = spread_of(points);
  const Spread to = spread_of(surface);
  std::vector<Mat3> rotations = {Mat3::Identity()};
  for (const Vec3& sign : {Vec3(1, 1, 1), Vec3(1, -1, -1), Vec3(-1, 1, -1), Vec3(-1, -1, 1)}) {
    rotations.emplace_back(to.axes * sign.asDiagonal() * from.axes.transpose());
  }
  std::vector<Similarity> poses;
  for (const Mat3& rotation : rotations) {
    Similarity pose;
    pose.scale = kind == AlignmentKind::kSimilarity && from.size > 0 ? to.size / from.size : 1.0;
    pose.rotation = rotation;
    pose.translation = to.center - pose.scale * (rotation * from.center);
    poses.push_back(pose);
  }
  return poses;
}

}  // namespace

AlignmentReport align_to_surface(std::span<const Vec3> points, const RayScene& truth,
                                 AlignmentKind kind, const AlignmentOptions& options) {
  if (kind == AlignmentKind::kNone) return {};
  constexpr std::size_t kFewest = 10;
  PENCILSCAN_CHECK(points.size() >= kFewest && !truth.mesh().faces.empty());
  const BoundingBox box = bounding_box(truth.mesh());
  const double size_mm = (box.high - box.low).norm();

  // Pick the start on a few points, then refine on many. A collapsed scale must not win: distances
  // count relative to it.
  constexpr std::size_t kCoarsePoints = 1000;
  constexpr int kCoarseSteps = 30;
  constexpr double kNear = 0.005;  // of the size: the points were about in place
  const auto coarse = evenly_picked(points, kCoarsePoints);
  AlignmentReport best = refine(coarse, truth, kind, {}, 0, kCoarseSteps, size_mm);
  const auto cost = [](const AlignmentReport& r) {
    return r.median_mm / r.truth_from_result.scale;
  };
  if (!(best.median_mm < kNear * size_mm && std::abs(best.truth_from_result.scale - 1) < 0.2)) {
    for (const Similarity& pose : coarse_poses(points, truth, kind)) {
      const auto other = refine(coarse, truth, kind, pose, 3, kCoarseSteps, size_mm);
      if (cost(other) < cost(best)) best = other;
    }
  }
  return refine(evenly_picked(points, options.max_points), truth, kind, best.truth_from_result, 0,
                options.max_iterations, size_mm);
}

TriangleMesh transformed(TriangleMesh mesh, const Similarity& b_from_a) {
  for (Vec3& v : mesh.vertices) v = b_from_a * v;
  return mesh;
}

}  // namespace pencilscan
