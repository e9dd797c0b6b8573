#include "pencilscan/artefact/coverage.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <vector>

#include "pencilscan/geometry/least_squares.h"
#include "pencilscan/surface/point_grid.h"

namespace pencilscan {
namespace {

constexpr double kReach = 0.01;  ///< of the diameter: by definition
constexpr int kSpherePlaces = 20'000;
constexpr int kPlatePlacesAlong = 200;  ///< two a reach, on the diagonal

bool has_point_within(const PointGrid& grid, const Vec3& place, double reach) {
  bool found = false;
  grid.for_each_within(place, reach, [&](std::size_t, double) { found = true; });
  return found;
}

/// Counter-clockwise convex hull of points in the plane (Andrew's monotone chain).
std::vector<Vec2> convex_hull(std::vector<Vec2> points) {
  std::sort(points.begin(), points.end(), [](const Vec2& a, const Vec2& b) {
    return a.x() < b.x() || (a.x() == b.x() && a.y() < b.y());
  });
  const auto turns_left = [](const Vec2& a, const Vec2& b, const Vec2& c) {
    return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x()) > 0;
  };
  std::vector<Vec2> hull;
  for (int pass = 0; pass < 2; ++pass) {
    const std::size_t first = hull.size();
    for (const Vec2& point : points) {
      while (hull.size() >= first + 2 && !turns_left(hull[hull.size() - 2], hull.back(), point))
        hull.pop_back();
      hull.push_back(point);
    }
    hull.pop_back();  // begins the other half
    std::reverse(points.begin(), points.end());
  }
  return hull;
}

}  // namespace

double sphere_coverage(std::span<const Vec3> points, const Sphere& sphere) {
  const double reach = kReach * 2 * sphere.radius;
  std::vector<Vec3> near;
  for (const Vec3& point : points) {
    if (std::abs((point - sphere.center).norm() - sphere.radius) <= reach)
      near.push_back(point - sphere.center);
  }
  const PointGrid grid(near, reach);
  const double golden = std::numbers::pi * (3 - std::sqrt(5.0));
  int covered = 0;
  for (int i = 0; i < kSpherePlaces; ++i) {
    const double z = 1 - (2.0 * i + 1) / kSpherePlaces;
    const double r = std::sqrt(1 - z * z);
    const Vec3 place(r * std::cos(golden * i), r * std::sin(golden * i), z);
    if (has_point_within(grid, sphere.radius * place, reach)) ++covered;
  }
  return static_cast<double>(covered) / kSpherePlaces;
}

PlateRectangle smallest_rectangle(std::span<const Vec3> points, const Plane& plane) {
  const Vec3 e1 = plane.normal.unitOrthogonal();
  const Vec3 e2 = plane.normal.cross(e1);
  std::vector<Vec2> flat;
  flat.reserve(points.size());
  for (const Vec3& point : points)
    flat.emplace_back(e1.dot(point - plane.point), e2.dot(point - plane.point));
  const std::vector<Vec2> hull = convex_hull(std::move(flat));
  PlateRectangle best;
  best.plane = plane;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < hull.size(); ++i) {
    const Vec2 side = (hull[(i + 1) % hull.size()] - hull[i]).normalized();
    const Vec2 across(-side.y(), side.x());
    Vec2 low = Vec2::Constant(std::numeric_limits<double>::infinity());
    Vec2 high = -low;
    for (const Vec2& corner : hull) {
      const Vec2 at(side.dot(corner), across.dot(corner));
      low = low.cwiseMin(at);
      high = high.cwiseMax(at);
    }
    const Vec2 size = high - low;
    if (!(size.x() * size.y() < least)) continue;
    least = size.x() * size.y();
    const Vec2 middle = 0.5 * (low.x() + high.x()) * side + 0.5 * (low.y() + high.y()) * across;
    const Vec2& longer = size.x() >= size.y() ? side : across;
    best.along = longer.x() * e1 + longer.y() * e2;
    best.center = plane.point + middle.x() * e1 + middle.y() * e2;
    best.length = size.maxCoeff();
    best.width = size.minCoeff();
  }
  return best;
}

namespace {

/// How far coordinates within a rectangle's plane lie beyond its sides, signed.
Vec2 overhang(const PlateRectangle& rectangle, const Vec2& at) {
  const Vec2 half(0.5 * rectangle.length, 0.5 * rectangle.width);
  return at - at.cwiseMax(-half).cwiseMin(half);
}

Vec2 within(const PlateRectangle& rectangle, const Vec3& point) {
  const Vec3 offset = point - rectangle.center;
  return {rectangle.along.dot(offset), rectangle.plane.normal.cross(rectangle.along).dot(offset)};
}

double cost_of(const PlateRectangle& rectangle, std::span<const Vec3> points, double tolerance) {
  double cost = 0;
  for (const Vec3& point : points)
    cost += std::min(overhang(rectangle, within(rectangle, point)).squaredNorm(),
                     tolerance * tolerance);
  return cost;
}

/// The points' middle and main direction.
PlateRectangle from_moments(std::span<const Vec3> points, const Plane& plane) {
  PlateRectangle rectangle;
  rectangle.plane = plane;
  const Vec3 e1 = plane.normal.unitOrthogonal();
  const Vec3 e2 = plane.normal.cross(e1);
  Vec2 mean = Vec2::Zero();
  Eigen::Matrix2d square = Eigen::Matrix2d::Zero();
  for (const Vec3& point : points) {
    const Vec2 at(e1.dot(point - plane.point), e2.dot(point - plane.point));
    mean += at;
    square += at * at.transpose();
  }
  mean /= static_cast<double>(points.size());
  square = square / static_cast<double>(points.size()) - mean * mean.transpose();
  const Vec2 main = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(square).eigenvectors().col(1);
  rectangle.along = main.x() * e1 + main.y() * e2;
  rectangle.center = plane.point + mean.x() * e1 + mean.y() * e2;
  return rectangle;
}

/// mm by which a turn of 1 rad moves a corner.
double lever_of(const PlateRectangle& rectangle) {
  return 0.5 * std::hypot(rectangle.length, rectangle.width);
}

/// Step of Gauss and Newton to less overhang: shifts along and across, and the turn by its lever.
Vec3 step_inwards(const PlateRectangle& now, std::span<const Vec3> points, double tolerance) {
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  Vec3 rest = Vec3::Zero();
  for (const Vec3& point : points) {
    const Vec2 at = within(now, point);
    const Vec2 over = overhang(now, at);
    if (over.squaredNorm() >= tolerance * tolerance) continue;
    for (int axis = 0; axis < 2; ++axis) {
      if (over[axis] == 0) continue;
      Vec3 slope = Vec3::Zero();
      slope[axis] = -1;
      slope.z() = (axis == 0 ? at.y() : -at.x()) / lever_of(now);
      squares += slope * slope.transpose();
      rest += slope * over[axis];
    }
  }
  if (rest.isZero(0)) return Vec3::Zero();
  squares.diagonal().array() += 1e-3 * squares.trace();  // where one side alone has points
  return -solve_symmetric(squares, rest);
}

}  // namespace

PlateRectangle placed_rectangle(std::span<const Vec3> points, const Plane& plane, double length,
                                double width, double tolerance) {
  constexpr int kRounds = 50;
  constexpr double kSettled = 1e-4;  // of the tolerance
  std::optional<PlateRectangle> best;
  double least = std::numeric_limits<double>::infinity();
  for (PlateRectangle now : {smallest_rectangle(points, plane), from_moments(points, plane)}) {
    now.length = std::max(length, width);
    now.width = std::min(length, width);
    for (int round = 0; round < kRounds; ++round) {
      const Vec3 step = step_inwards(now, points, tolerance);
      const Vec3 across = plane.normal.cross(now.along);
      now.center += step.x() * now.along + step.y() * across;
      const double turn = step.z() / lever_of(now);
      now.along = (std::cos(turn) * now.along + std::sin(turn) * across).normalized();
      if (step.norm() < kSettled * tolerance) break;
    }
    const double cost = cost_of(now, points, tolerance);
    if (!best || cost < least) {
      best = now;
      least = cost;
    }
  }
  return *best;
}

double plate_coverage(std::span<const Vec3> points, const PlateRectangle& plate) {
  const double diagonal = std::hypot(plate.length, plate.width);
  const double reach = kReach * diagonal;
  if (!(reach > 0)) return 0;
  const Vec3 across = plate.plane.normal.cross(plate.along);
  const auto flat = [&](const Vec3& x) -> Vec3 {
    return {plate.along.dot(x - plate.center), across.dot(x - plate.center), 0};
  };
  std::vector<Vec3> near;
  for (const Vec3& point : points) {
    const Vec3 at = flat(point);
    if (at.norm() <= diagonal) near.push_back(at);
  }
  const PointGrid grid(near, reach);
  const double step = diagonal / kPlatePlacesAlong;
  const auto places = [&](double side) { return std::max(1, static_cast<int>(side / step)); };
  const int columns = places(plate.length), rows = places(plate.width);
  int covered = 0;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const Vec3 place(((column + 0.5) / columns - 0.5) * plate.length,
                       ((row + 0.5) / rows - 0.5) * plate.width, 0);
      if (has_point_within(grid, place, reach)) ++covered;
    }
  }
  return static_cast<double>(covered) / (static_cast<double>(rows) * columns);
}

}  // namespace pencilscan
