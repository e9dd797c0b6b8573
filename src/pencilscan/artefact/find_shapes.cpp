#include "pencilscan/artefact/find_shapes.h"

#include <cmath>
#include <utility>
#include <vector>

#include "pencilscan/artefact/sphere_fit.h"
#include "pencilscan/core/evenly_picked.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/random.h"

namespace pencilscan {
namespace {

/// All of four points lie on a ball that holds half of them once in 16 draws, on one that holds a
/// quarter once in 256: of 2000 draws eight, and the chance of none is 4e-4.
constexpr int kDraws = 2000;
/// Points that vote; more refine a start that is refined anyway.
constexpr std::size_t kVoters = 3000;
constexpr double kOfExtent = 0.01;

/// Twice the median distance from the middle one per axis: few far points do not change it.
double extent_of(const std::vector<Vec3>& points) {
  Vec3 center;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Vec3& point : points) values.push_back(point(axis));
    center(axis) = upper_median(std::move(values));
  }
  std::vector<double> distances;
  for (const Vec3& point : points) distances.push_back((point - center).norm());
  return 2 * upper_median(std::move(distances));
}

template <typename Shape, typename Draw, typename Distance>
std::optional<Shape> most_voted(const std::vector<Vec3>& voters, double tolerance, const Draw& draw,
                                const Distance& distance) {
  std::optional<Shape> best;
  std::size_t most = 0;
  for (int i = 0; i < kDraws; ++i) {
    const std::optional<Shape> shape = draw();
    if (!shape) continue;
    std::size_t votes = 0;
    for (const Vec3& voter : voters) votes += std::abs(distance(*shape, voter)) < tolerance ? 1 : 0;
    if (votes > most) {
      most = votes;
      best = shape;
    }
  }
  return best;
}

}  // namespace

std::optional<Sphere> find_sphere(std::span<const Vec3> points, const SphereSearch& search) {
  if (points.size() < 4) return std::nullopt;
  const std::vector<Vec3> voters = evenly_picked(points, kVoters);
  const double extent = extent_of(voters);
  const auto acceptable = [&](const Sphere& sphere) {
    if (search.not_here &&
        (sphere.center - search.not_here->center).norm() <= search.not_here->radius) {
      return false;
    }
    // Of a small cap the median is a fraction of the radius; a plane would be a larger sphere yet.
    constexpr double kLargest = 10;
    return search.radius
               ? std::abs(sphere.radius - *search.radius) <= kSizeTolerance * *search.radius
               : sphere.radius <= kLargest * extent;
  };
  Random random(search.seed);
  const auto pick = [&]() -> const Vec3& {
    return voters[random.below(static_cast<std::uint32_t>(voters.size()))];
  };
  const auto draw = [&]() -> std::optional<Sphere> {
    const Vec3 &a = pick(), &b = pick(), &c = pick(), &d = pick();
    const auto sphere = sphere_through(a, b, c, d);
    return sphere && acceptable(*sphere) ? sphere : std::nullopt;
  };
  return most_voted<Sphere>(
      voters, search.radius ? kOnSphere * *search.radius : kOfExtent * extent, draw,
      [](const Sphere& sphere, const Vec3& point) { return signed_distance(sphere, point); });
}

std::optional<Plane> find_plane(std::span<const Vec3> points, std::uint64_t seed,
                                std::optional<double> tolerance) {
  if (points.size() < 3) return std::nullopt;
  const std::vector<Vec3> voters = evenly_picked(points, kVoters);
  Random random(seed);
  const auto pick = [&]() -> const Vec3& {
    return voters[random.below(static_cast<std::uint32_t>(voters.size()))];
  };
  const auto draw = [&]() -> std::optional<Plane> {
    const Vec3 &a = pick(), &b = pick(), &c = pick();
    const Vec3 normal = (b - a).cross(c - a);
    if (!(normal.norm() > 0)) return std::nullopt;
    return Plane{a, normal.normalized()};
  };
  return most_voted<Plane>(
      voters, tolerance.value_or(kOfExtent * extent_of(voters)), draw,
      [](const Plane& plane, const Vec3& point) { return plane.signed_distance(point); });
}

}  // namespace pencilscan
