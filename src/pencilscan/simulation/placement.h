#pragma once

#include "pencilscan/geometry/mesh.h"

namespace pencilscan {

/// The axis of a mesh file that points up; the world's is z.
enum class UpAxis { kX, kY, kZ };
/// The mesh turned so that `up` becomes z.
[[nodiscard]] TriangleMesh turned_upright(TriangleMesh mesh, UpAxis up);

/// The mesh without vertices of no face, centred in the volume (middle of its bounding box) and
/// scaled so that its farthest vertex lies at `fill` of the radius, 0 < fill <= 1. A mesh without
/// extent is only centred.
[[nodiscard]] TriangleMesh fitted(TriangleMesh mesh, const Sphere& volume, double fill = 0.95);

/// Rigid motion per frame: a turn about the vertical through `pivot`, then a shift.
struct Motion {
  double rotate_rad = 0;             ///< counter-clockwise seen from above, per frame
  Vec3 translate_mm = Vec3::Zero();  ///< per frame
  Vec3 pivot = Vec3::Zero();         ///< world, mm

  /// Where frame `frame` (0: not moved) has the object.
  [[nodiscard]] RigidTransform at(int frame) const;
};

/// Rigid motion at even speed within one exposure: a turn about an axis through `pivot`, and a
/// shift.
struct ExposurePath {
  Vec3 shift = Vec3::Zero();     ///< mm, world, from the exposure's start to its end
  Vec3 turn_rad = Vec3::Zero();  ///< the axis times the angle, likewise
  Vec3 pivot = Vec3::Zero();     ///< world, mm

  /// What has moved since the middle of the exposure; `share`: of the exposure, -0.5 to 0.5.
  [[nodiscard]] RigidTransform since_middle(double share) const;
};

}  // namespace pencilscan
