#pragma once

#include <span>

#include "pencilscan/artefact/plane_fit.h"
#include "pencilscan/geometry/types.h"

namespace pencilscan {

/// Share of a sphere's surface that lies within 1 % of its diameter of a point. By 20,000 places
/// spread evenly over the sphere (a Fibonacci lattice), so to about half a per cent.
[[nodiscard]] double sphere_coverage(std::span<const Vec3> points, const Sphere& sphere);

/// The rectangle of a plate's surface.
struct PlateRectangle {
  Plane plane;
  Vec3 along = Vec3::UnitX();  ///< unit, in the plane: the longer side's direction
  Vec3 center = Vec3::Zero();
  double length = 0;  ///< >= width
  double width = 0;
};
/// The rectangle of least area in the plane that holds all points, projected onto it. (One of its
/// sides lies on a side of their convex hull: Freeman, Shapira, CACM 18 (7), 1975.)
[[nodiscard]] PlateRectangle smallest_rectangle(std::span<const Vec3> points, const Plane& plane);

/// A rectangle of known sides, placed in the plane so that the points stand out of it least: the
/// sum of their squared overhangs, none counted farther than `tolerance` (> 0, mm). Points far
/// beyond the rim, which are errors, do not move it. Where the points fill less than the rectangle
/// and none stands out, it stays in their middle.
[[nodiscard]] PlateRectangle placed_rectangle(std::span<const Vec3> points, const Plane& plane,
                                              double length, double width, double tolerance);

/// Share of the rectangle within 1 % of its diagonal of a point (measured in the plane).
[[nodiscard]] double plate_coverage(std::span<const Vec3> points, const PlateRectangle& plate);

}  // namespace pencilscan
