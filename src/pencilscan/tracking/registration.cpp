#include "pencilscan/tracking/registration.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "pencilscan/core/chunks.h"
#include "pencilscan/core/median.h"
#include "pencilscan/geometry/least_squares.h"
#include "pencilscan/geometry/ray_scene.h"
#include "pencilscan/surface/point_grid.h"

namespace pencilscan {
namespace {

constexpr std::size_t kMostTargets = 6000;  // 6 unknowns of a part need some hundreds around it
constexpr double kLeastCosine = 0.5;        // between normals that may be one place
constexpr double kFarthest = 12;            // spacings, of a place from where it was predicted
constexpr int kRigidRounds = 12;
constexpr double kLeastRadius = 4;  // spacings, of a part: follow_nodes() does what is smaller

/// A later point and the place of the mesh that it may be.
struct Match {
  Vec3 at = Vec3::Zero();       ///< on the mesh
  Vec3 normal = Vec3::UnitZ();  ///< of the later surface
  double gap = 0;               ///< how far the place must move along the normal
  bool found = false;
};

/// Every so many samples.
std::vector<SurfaceSample> some_of(std::span<const SurfaceSample> samples) {
  const std::size_t step = (samples.size() + kMostTargets - 1) / kMostTargets;
  std::vector<SurfaceSample> some;
  for (std::size_t i = 0; i < samples.size(); i += std::max<std::size_t>(1, step))
    some.push_back(samples[i]);
  return some;
}

/// Matches of the samples with a mesh that has moved by `motion` since its scene was made.
std::vector<Match> matches(const RayScene& scene, std::span<const SurfaceSample> later,
                           const RigidTransform& motion, double reach) {
  const RigidTransform back = motion.inverse();
  std::vector<Match> result(later.size());
  parallel_chunks(later.size(), [&](std::size_t i) {
    const auto closest = scene.closest_point(back * later[i].position, reach);
    if (!closest) return;
    const Vec3 facing = motion.rotation * face_normal(scene.mesh(), closest->face);
    if (facing.dot(later[i].normal) < kLeastCosine) return;
    Match& match = result[i];
    match.at = motion * closest->point;
    match.normal = later[i].normal;
    match.gap = match.normal.dot(later[i].position - match.at);
    match.found = true;
  });
  return result;
}

/// Standard deviation of the gaps by their median; spacing / 2 at least.
double gap_scale(std::span<const Match> found, double spacing) {
  std::vector<double> gaps;
  for (const Match& match : found) {
    if (match.found) gaps.push_back(std::abs(match.gap));
  }
  const double least = 0.5 * spacing;
  return gaps.empty() ? least
                      : std::max(least, kDeviationPerMedian * upper_median(std::move(gaps)));
}

/// Small rigid motion about a center, in lengths: rotations are times `radius`.
struct Twist {
  Vec3 rotation = Vec3::Zero();
  Vec3 shift = Vec3::Zero();

  [[nodiscard]] Vec3 of(const Vec3& offset, double radius) const {
    return shift + rotation.cross(offset) / radius;
  }
};

/// Least squares of gaps over a part; what the normals do not fix stays small.
class TwistFit {
 public:
  explicit TwistFit(double radius) : radius_(radius) {}

  void add(const Match& match, const Vec3& offset, double weight) {
    const Vec3 turn = offset.cross(match.normal) / radius_;
    const std::array<double, 6> row{turn[0],         turn[1],         turn[2],
                                    match.normal[0], match.normal[1], match.normal[2]};
    double* sum = A_.data();
    for (std::size_t i = 0; i < 6; ++i) {
      const double weighted = weight * row[i];
      for (std::size_t j = 0; j < 6; ++j) *sum++ += weighted * row[j];
      b_[static_cast<Eigen::Index>(i)] += weighted * match.gap;
    }
    weight_ += weight;
  }

  [[nodiscard]] double weight() const { return weight_; }

  [[nodiscard]] Twist solve(double ridge) const {
    const Vec6 x = solve_symmetric(Mat6(A_ + ridge * weight_ * Mat6::Identity()), b_);
    return {x.head<3>(), x.tail<3>()};
  }

 private:
  double radius_;
  Mat6 A_ = Mat6::Zero();
  Vec6 b_ = Vec6::Zero();
  double weight_ = 0;
};

/// Weight of a gap that may belong to another surface (Tukey's biweight at 4 deviations).
double trust(double gap, double scale) {
  const double off = gap / (4 * scale);
  return std::abs(off) < 1 ? (1 - off * off) * (1 - off * off) : 0;
}

/// The whole moves until it lies on the samples.
RigidTransform rigid_motion(const TriangleMesh& mesh, std::span<const SurfaceSample> later,
                            double spacing, double extent, const RigidTransform& predicted) {
  const RayScene scene(mesh);
  RigidTransform motion = predicted;
  double reach = kFarthest * spacing;
  for (int round = 0; round < kRigidRounds; ++round) {
    const std::vector<Match> found = matches(scene, later, motion, reach);
    const double scale = gap_scale(found, spacing);
    Vec3 center = Vec3::Zero();
    double count = 0;
    for (const Match& match : found) {
      if (!match.found) continue;
      center += match.at;
      ++count;
    }
    if (count < 100) return predicted;
    center /= count;
    TwistFit fit(extent);
    for (const Match& match : found) {
      if (match.found) fit.add(match, match.at - center, trust(match.gap, scale));
    }
    // Sliding along a body of revolution cannot be seen: a small ridge keeps it from running away.
    const Twist twist = fit.solve(1e-4);
    if (!twist.shift.allFinite() || !twist.rotation.allFinite()) return predicted;
    const Vec3 turn = twist.rotation / extent;
    const double angle = turn.norm();
    RigidTransform step;
    if (angle > 0) step.rotation = Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
    step.translation = center + twist.shift - step.rotation * center;
    motion = step * motion;
    reach = std::clamp(8 * scale, 4 * spacing, reach);
    if (twist.shift.norm() + twist.rotation.norm() < 0.01 * spacing) break;
  }
  return motion;
}

/// Centres of parts: means of the vertices in cubes.
std::vector<Vec3> part_centers(std::span<const Vec3> vertices, double side) {
  struct Sum {
    Vec3 of = Vec3::Zero();
    double count = 0;
  };
  std::map<std::array<int, 3>, Sum> cubes;
  for (const Vec3& x : vertices) {
    Sum& sum = cubes[{static_cast<int>(std::floor(x.x() / side)),
                      static_cast<int>(std::floor(x.y() / side)),
                      static_cast<int>(std::floor(x.z() / side))}];
    sum.of += x;
    ++sum.count;
  }
  std::vector<Vec3> centers;
  centers.reserve(cubes.size());
  for (const auto& [cube, sum] : cubes) centers.push_back(sum.of / sum.count);
  return centers;
}

/// Parts of one size move, each rigidly; between them, motion is blended.
void move_parts(std::span<const SurfaceSample> later, double spacing, double radius,
                TriangleMesh& mesh) {
  constexpr double kRidge = 0.02;  // of the points' weight: a part that nothing holds stays
  constexpr double kEnough = 30;   // points around a part that settle its motion
  const RayScene scene(mesh);
  const std::vector<Match> found = matches(scene, later, {}, kFarthest * spacing);
  const double scale = gap_scale(found, spacing);
  std::vector<Vec3> places;
  std::vector<std::size_t> of_place;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (!found[i].found) continue;
    places.push_back(found[i].at);
    of_place.push_back(i);
  }
  const PointGrid grid(places, radius);
  const std::vector<Vec3> centers = part_centers(mesh.vertices, 0.5 * radius);
  std::vector<Twist> twists(centers.size());
  std::vector<double> say(centers.size());
  parallel_chunks(centers.size(), [&](std::size_t a) {
    TwistFit fit(radius);
    grid.for_each_within(centers[a], radius, [&](std::size_t k, double distance2) {
      const Match& match = found[of_place[k]];
      const double bell = 1 - distance2 / (radius * radius);
      fit.add(match, match.at - centers[a], bell * bell * trust(match.gap, scale));
    });
    say[a] = std::min(1.0, fit.weight() / kEnough);
    if (fit.weight() > 0) twists[a] = fit.solve(kRidge);
  });
  const PointGrid parts(centers, radius);
  parallel_chunks(mesh.vertices.size(), [&](std::size_t v) {
    Vec3& x = mesh.vertices[v];
    Vec3 sum = Vec3::Zero();
    double total = std::numeric_limits<double>::min();
    parts.for_each_within(x, radius, [&](std::size_t a, double distance2) {
      const double bell = 1 - distance2 / (radius * radius);
      const double weight = bell * bell * say[a];
      sum += weight * twists[a].of(x - centers[a], radius);
      total += weight;
    });
    if (sum.allFinite()) x += sum / total;
  });
}

}  // namespace

Registration register_surface(const TriangleMesh& mesh, std::span<const SurfaceSample> later,
                              double spacing, const RigidTransform& predicted) {
  const std::vector<SurfaceSample> targets = some_of(later);
  const BoundingBox box = bounding_box(mesh);
  const double extent = (box.high - box.low).maxCoeff();
  Registration result;
  result.motion = rigid_motion(mesh, targets, spacing, 0.5 * extent, predicted);
  TriangleMesh moved = mesh;
  for (Vec3& x : moved.vertices) x = result.motion * x;
  for (double radius = extent / 4; radius >= kLeastRadius * spacing; radius /= 2) {
    for (int round = 0; round < 2; ++round) move_parts(targets, spacing, radius, moved);
  }
  result.vertices = std::move(moved.vertices);
  return result;
}

}  // namespace pencilscan
