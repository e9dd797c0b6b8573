#include "pencilscan/artefact/known_ball.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "pencilscan/artefact/find_shapes.h"
#include "pencilscan/artefact/sphere_fit.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/length_units.h"

namespace pencilscan {
namespace {

/// Whether a ball of this radius is found. What is small beside a ball lies near one of any place:
/// no more is asked of than is four times as large as what the points reach over.
bool holds_ball(std::span<const Vec3> points, double radius, std::uint64_t seed) {
  constexpr double kLargest = 4;
  Vec3 low = points.front(), high = low;
  for (const Vec3& point : points) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  if (2 * radius > kLargest * (high - low).norm()) return false;
  const auto found = find_sphere(points, {radius, {}, seed});
  return found && is_ball(points, refined(points, *found), radius);
}

}  // namespace

bool is_near(const Sphere& sphere, const Vec3& point) {
  constexpr double kNear = 0.05;  // of the radius
  return std::abs(signed_distance(sphere, point)) < kNear * sphere.radius;
}

Sphere refined(std::span<const Vec3> points, const Sphere& found) {
  std::vector<Vec3> near;
  for (const Vec3& point : points)
    if (is_near(found, point)) near.push_back(point);
  return fit_sphere(near, found).value_or(found);
}

bool has_size(const Sphere& sphere, double radius) {
  return std::abs(sphere.radius - radius) <= kSizeTolerance * radius;
}

bool is_ball(std::span<const Vec3> points, const Sphere& found, double radius) {
  constexpr double kLeastShare = 0.25;
  const auto near = std::count_if(points.begin(), points.end(),
                                  [&](const Vec3& point) { return is_near(found, point); });
  return has_size(found, radius) &&
         static_cast<double>(near) >= kLeastShare * static_cast<double>(points.size());
}

std::string unit_advice(std::span<const Vec3> points, double diameter_mm, std::uint64_t seed) {
  const auto advice = [](double size, const char* what, const UnitFactor& unit) {
    return "; one of " + formatted(size, "%.4g") + " mm does: " + what + " probably in " +
           unit.words + ", to be multiplied by " + formatted(unit.factor, "%.6g");
  };
  for (const UnitFactor& unit : kInsteadOfMillimetres) {
    if (unit.factor < 1) continue;  // what is in micrometres is seldom a scan
    const double smaller = diameter_mm / unit.factor, larger = diameter_mm * unit.factor;
    if (holds_ball(points, smaller / 2, seed)) return advice(smaller, "the points are", unit);
    if (holds_ball(points, larger / 2, seed)) return advice(larger, "--diameter is", unit);
  }
  return {};
}

}  // namespace pencilscan
