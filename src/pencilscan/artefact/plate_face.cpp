#include "pencilscan/artefact/plate_face.h"

#include <cmath>

#include "pencilscan/artefact/coverage.h"
#include "pencilscan/artefact/find_shapes.h"

namespace pencilscan {
FacePoints points_of_face(const ArtefactPoints& points, const PlateFace& face) {
  const double thickness = face.thickness_mm;
  const auto found = find_plane(points.points, face.seed, thickness / 4);
  if (!found) return {points, {}, {}};
  std::vector<Vec3> near;
  for (const Vec3& point : points.points)
    if (std::abs(found->signed_distance(point)) < thickness / 4) near.push_back(point);
  Plane plane = fit_plane(near).value_or(*found);
  // Outwards is away from the other face.
  std::size_t before = 0, behind = 0;
  for (const Vec3& point : points.points) {
    const double d = plane.signed_distance(point) / thickness;
    before += d > 0.5 && d < 1.5 ? 1 : 0;
    behind += d < -0.5 && d > -1.5 ? 1 : 0;
  }
  if (before > behind) plane.normal = -plane.normal;
  constexpr double kOtherFace = 0.01;  // of the points: fewer are errors rather than a face
  const bool two_faces = static_cast<double>(std::max(before, behind)) >
                         kOtherFace * static_cast<double>(points.points.size());
  const PlateRectangle rim =
      face.length_mm && face.width_mm
          ? placed_rectangle(near, plane, *face.length_mm, *face.width_mm, thickness / 4)
          : smallest_rectangle(near, plane);
  const Vec3 across = plane.normal.cross(rim.along);
  std::vector<std::size_t> kept;
  for (std::size_t i = 0; i < points.points.size(); ++i) {
    const Vec3 offset = points.points[i] - rim.center;
    const bool inside = std::abs(rim.along.dot(offset)) <= rim.length / 2 - face.border_mm &&
                        std::abs(across.dot(offset)) <= rim.width / 2 - face.border_mm;
    const bool is_other = two_faces && plane.signed_distance(points.points[i]) < -thickness / 2;
    if (inside && !is_other) kept.push_back(i);
  }
  return {points.subset(kept), rim, connected_surface(near, rim)};
}

}  // namespace pencilscan
