#include "pencilscan/simulation/placement.h"

#include <algorithm>
#include <utility>

#include "pencilscan/core/check.h"
#include "pencilscan/geometry/used_vertices.h"

namespace pencilscan {

TriangleMesh turned_upright(TriangleMesh mesh, UpAxis up) {
  for (Vec3& v : mesh.vertices) {
    if (up == UpAxis::kX) v = Vec3(v.y(), v.z(), v.x());
    if (up == UpAxis::kY) v = Vec3(v.z(), v.x(), v.y());
  }
  return mesh;
}

TriangleMesh fitted(TriangleMesh mesh, const Sphere& volume, double fill) {
  PENCILSCAN_CHECK(fill > 0 && fill <= 1);
  mesh = without_unused_vertices(std::move(mesh));
  const BoundingBox box = bounding_box(mesh);
  const Vec3 middle = 0.5 * (box.low + box.high);
  double reach = 0;
  for (const Vec3& v : mesh.vertices) reach = std::max(reach, (v - middle).norm());
  const double scale = reach > 0 ? fill * volume.radius / reach : 1;
  for (Vec3& v : mesh.vertices) v = volume.center + scale * (v - middle);
  return mesh;
}

RigidTransform Motion::at(int frame) const {
  const Mat3 turn = Eigen::AngleAxisd(frame * rotate_rad, Vec3::UnitZ()).toRotationMatrix();
  return {turn, pivot - turn * pivot + frame * translate_mm};
}

RigidTransform ExposurePath::since_middle(double share) const {
  const double angle = turn_rad.norm();
  if (angle == 0) return {Mat3::Identity(), share * shift};
  const Mat3 turn = Eigen::AngleAxisd(share * angle, turn_rad / angle).toRotationMatrix();
  return {turn, pivot - turn * pivot + share * shift};
}

}  // namespace pencilscan
