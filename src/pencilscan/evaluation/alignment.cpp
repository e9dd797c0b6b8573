#include "pencilscan/evaluation/alignment.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "pencilscan/core/check.h"
#include "pencilscan/core/chunks.h"
#include "pencilscan/core/evenly_picked.h"
#include "pencilscan/core/median.h"
#include "pencilscan/evaluation/closest_lattice.h"
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

/// Where the points lie at a pose, and what of the truth is closest to each.
using Matcher =
    std::function<std::vector<Match>(std::span<const Vec3> points, const Similarity& pose)>;

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

std::vector<Match> match(std::span<const Vec3> points, const ClosestLattice& truth,
                         const Similarity& pose) {
  std::vector<Match> matches;
  matches.reserve(points.size());
  for (const Vec3& point : points) {
    const Vec3 moved = pose * point;
    const auto& [closest, normal] = truth.nearest(moved);
    matches.push_back({moved, closest, normal, (closest - moved).norm()});
  }
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

AlignmentReport refine(std::span<const Vec3> points, const Matcher& match_at, AlignmentKind kind,
                       const Similarity& start, int point_steps, int max_iterations,
                       double size_mm) {
  AlignmentReport report;
  report.truth_from_result = start;
  for (; report.iterations < max_iterations; ++report.iterations) {
    const auto matches = match_at(points, report.truth_from_result);
    const Similarity step = report.iterations < point_steps ? point_step(matches, kind)
                                                            : plane_step(matches, kind, size_mm);
    report.truth_from_result = compose(step, report.truth_from_result);
    double moved = 0;
    for (const Match& m : matches) moved = std::max(moved, (step * m.moved - m.moved).norm());
    if (report.iterations >= point_steps && moved < 1e-7 * size_mm) break;
  }
  report.median_mm = median_distance(match_at(points, report.truth_from_result));
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

/// Rotations spread evenly: spirals over the quaternions (M. Alexa, Super-Fibonacci Spirals, CVPR
/// 2022).
std::vector<Mat3> even_rotations(int count) {
  constexpr double kFirst = std::numbers::sqrt2;
  constexpr double kSecond = 1.533751168755204288;  // the paper's psi: psi^4 = psi + 4
  std::vector<Mat3> rotations;
  for (int i = 0; i < count; ++i) {
    const double s = i + 0.5;
    const double inner = std::sqrt(s / count);
    const double outer = std::sqrt(1 - s / count);
    const double alpha = 2 * std::numbers::pi * s / kFirst;
    const double beta = 2 * std::numbers::pi * s / kSecond;
    const Eigen::Quaterniond q(outer * std::cos(beta), inner * std::sin(alpha),
                               inner * std::cos(alpha), outer * std::sin(beta));
    rotations.push_back(q.normalized().toRotationMatrix());
  }
  return rotations;
}

/// As it is; then poses that match centroid and size of the two: unturned, turned about z (a
/// calibrated rig's z is up, but its x is the first camera's), turned by the principal axes, and
/// turned in every way.
std::vector<Similarity> starting_poses(const Spread& from, const Spread& to, AlignmentKind kind) {
  constexpr int kTurns = 24;     // 15 degrees apart
  constexpr int kEvenly = 1000;  // about 25 degrees apart
  std::vector<Mat3> rotations;
  for (int i = 0; i < kTurns; ++i) {
    const double angle = 2 * std::numbers::pi * i / kTurns;
    rotations.push_back(Eigen::AngleAxisd(angle, Vec3::UnitZ()).toRotationMatrix());
  }
  for (const Vec3& sign : {Vec3(1, 1, 1), Vec3(1, -1, -1), Vec3(-1, 1, -1), Vec3(-1, -1, 1)})
    rotations.emplace_back(to.axes * sign.asDiagonal() * from.axes.transpose());
  for (const Mat3& rotation : even_rotations(kEvenly)) rotations.push_back(rotation);
  std::vector<Similarity> poses(1);
  for (const Mat3& rotation : rotations) {
    Similarity pose;
    pose.scale = kind == AlignmentKind::kSimilarity && from.size > 0 ? to.size / from.size : 1.0;
    pose.rotation = rotation;
    pose.translation = to.center - pose.scale * (rotation * from.center);
    poses.push_back(pose);
  }
  return poses;
}

/// A pose, and how well the points fit there.
struct Candidate {
  AlignmentReport report;
  double cost = 0;  ///< mean distance of the points, none counted farther than `cut`; result's unit
};

/// Distances count relative to the scale: a collapsed one must not win.
double cost_of(const std::vector<Match>& matches, double scale, double cut) {
  double sum = 0;
  // A pose that is no number costs as much as can be.
  for (const Match& m : matches) sum += std::min(cut, m.distance / scale);
  return sum / static_cast<double>(matches.size());
}

/// Mean distance between where two poses put the points, in the truth's unit.
double apart(std::span<const Vec3> points, const Similarity& a, const Similarity& b) {
  double sum = 0;
  for (const Vec3& point : points) sum += (a * point - b * point).norm();
  return sum / static_cast<double>(points.size());
}

/// The search for the pose, from coarse to fine.
class PoseSearch {
 public:
  PoseSearch(std::span<const Vec3> points, const RayScene& truth, AlignmentKind kind)
      : truth_(truth), kind_(kind), from_(spread_of(points)) {
    constexpr std::size_t kFewPoints = 250;
    constexpr std::size_t kSomePoints = 2000;
    constexpr std::size_t kSurfaceSamples = 5000;
    few_ = evenly_picked(points, kFewPoints);
    some_ = evenly_picked(points, kSomePoints);
    for (const auto& s : sample_surface(truth.mesh(), kSurfaceSamples, 1))
      surface_.push_back(s.point);
    // What is farther off counts alike. Chosen.
    constexpr double kCut = 0.05;
    cut_ = kCut * from_.size;
    const BoundingBox box = bounding_box(truth.mesh());
    size_mm_ = (box.high - box.low).norm();
  }

  /// The best pose, with its rival. Where several are about as good, the one that moves least:
  /// as it is, then unturned.
  [[nodiscard]] AlignmentReport best() const {
    std::vector<Candidate> finer = shortlist();
    for (Candidate& candidate : finer) refine_on_truth(candidate);
    // Of so many points the mean is known to 2 %; they are not independent of each other.
    constexpr double kAlike = 1.1;
    double least = finer.front().cost;
    for (const Candidate& candidate : finer) least = std::min(least, candidate.cost);
    const auto best = std::find_if(finer.begin(), finer.end(), [&](const Candidate& candidate) {
      return candidate.cost <= kAlike * least + rounding();
    });
    AlignmentReport report = best->report;
    // Where the shape differs by less than the points deviate, they cannot tell the poses apart.
    double rival_cost = 2 * best->cost + rounding();
    for (const Candidate& other : finer) {
      if (other.cost > rival_cost || is_same(other, *best)) continue;
      rival_cost = other.cost;
      report.rival = rival(other.report, best->report);
    }
    return report;
  }

 private:
  /// In the result's unit; far above what the rounding of positions to float makes.
  [[nodiscard]] double rounding() const { return 1e-5 * from_.size; }

  /// The few best ends of all starts by a lattice of closest points, those of the first two always,
  /// each of another pose.
  [[nodiscard]] std::vector<Candidate> shortlist() const {
    constexpr int kPointSteps = 3;
    constexpr int kSteps = 15;
    constexpr std::size_t kKept = 12;
    constexpr std::ptrdiff_t kLeastTurned = 2;
    const ClosestLattice lattice(truth_);
    const Matcher by_lattice = [&](std::span<const Vec3> points, const Similarity& pose) {
      return match(points, lattice, pose);
    };
    const auto starts = starting_poses(from_, spread_of(surface_), kind_);
    std::vector<Candidate> ends(starts.size());
    parallel_for(starts.size(), [&](std::size_t i) {
      const int point_steps = i == 0 ? 0 : kPointSteps;
      ends[i].report = refine(few_, by_lattice, kind_, starts[i], point_steps, kSteps, size_mm_);
      const Similarity& pose = ends[i].report.truth_from_result;
      ends[i].cost = cost_of(by_lattice(few_, pose), pose.scale, cut_);
    });
    std::stable_sort(ends.begin() + kLeastTurned, ends.end(),
                     [](const Candidate& a, const Candidate& b) { return a.cost < b.cost; });
    std::vector<Candidate> kept;
    for (const Candidate& end : ends) {
      if (kept.size() == kKept) break;
      const auto is_near = [&](const Candidate& other) {
        return apart(few_, end.report.truth_from_result, other.report.truth_from_result) <
               2 * lattice.step_mm();
      };
      if (std::ssize(kept) < kLeastTurned || std::none_of(kept.begin(), kept.end(), is_near))
        kept.push_back(end);
    }
    return kept;
  }

  void refine_on_truth(Candidate& candidate) const {
    constexpr int kSteps = 30;
    const Matcher exact = [&](std::span<const Vec3> points, const Similarity& pose) {
      return match(points, truth_, pose);
    };
    candidate.report =
        refine(some_, exact, kind_, candidate.report.truth_from_result, 0, kSteps, size_mm_);
    const Similarity& pose = candidate.report.truth_from_result;
    candidate.cost = cost_of(exact(some_, pose), pose.scale, cut_);
  }

  /// Whether the figures are the same at both: the poses are, or the motion from one to the other
  /// brings the truth onto itself, but for less than the points deviate.
  [[nodiscard]] bool is_same(const Candidate& a, const Candidate& b) const {
    const Similarity& pose_a = a.report.truth_from_result;
    const Similarity& pose_b = b.report.truth_from_result;
    const double noise_mm = pose_b.scale * (b.cost + rounding());
    if (apart(some_, pose_a, pose_b) <= noise_mm) return true;
    const auto moved = match(surface_, truth_, compose(pose_a, pose_b.inverse()));
    return cost_of(moved, 1, pose_b.scale * cut_) <= noise_mm;
  }

  static AlignmentRival rival(const AlignmentReport& other, const AlignmentReport& best) {
    const Eigen::AngleAxisd turn(
        Mat3(other.truth_from_result.rotation * best.truth_from_result.rotation.transpose()));
    return {turn.angle(), other.median_mm};
  }

  const RayScene& truth_;
  AlignmentKind kind_;
  Spread from_;
  double cut_ = 0;      ///< result's unit
  double size_mm_ = 0;  ///< of the truth
  std::vector<Vec3> few_, some_, surface_;
};

}  // namespace

AlignmentReport align_to_surface(std::span<const Vec3> points, const RayScene& truth,
                                 AlignmentKind kind, const AlignmentOptions& options) {
  if (kind == AlignmentKind::kNone) return {};
  constexpr std::size_t kFewest = 10;
  PENCILSCAN_CHECK(points.size() >= kFewest && !truth.mesh().faces.empty());
  const AlignmentReport found = PoseSearch(points, truth, kind).best();
  const BoundingBox box = bounding_box(truth.mesh());
  AlignmentReport report = refine(
      evenly_picked(points, options.max_points),
      [&](std::span<const Vec3> some, const Similarity& pose) { return match(some, truth, pose); },
      kind, found.truth_from_result, 0, options.max_iterations, (box.high - box.low).norm());
  report.rival = found.rival;
  return report;
}

TriangleMesh transformed(TriangleMesh mesh, const Similarity& b_from_a) {
  for (Vec3& v : mesh.vertices) v = b_from_a * v;
  return mesh;
}

}  // namespace pencilscan
