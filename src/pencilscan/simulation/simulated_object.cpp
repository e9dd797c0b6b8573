#include "pencilscan/simulation/simulated_object.h"

#include <algorithm>

#include "pencilscan/core/check.h"

namespace pencilscan {

SimulatedObject::SimulatedObject(const TriangleMesh& mesh, Reflectance surface,
                                 const RigidTransform& world_from_object)
    : surface_(surface),
      world_from_object_(world_from_object),
      object_from_world_(world_from_object.inverse()),
      rays_(transformed(mesh, world_from_object)),
      normals_(vertex_normals(rays_.mesh())) {
  PENCILSCAN_CHECK(!mesh.faces.empty());
  // Embree works in float: coordinates of this size are good to 6e-8 of it; 1e-5 is far above that
  // and, at 3 um for an object of 300 mm, far below a pixel.
  const BoundingBox box = bounding_box(rays_.mesh());
  shadow_offset_mm_ =
      1e-5 * std::max(box.low.cwiseAbs().maxCoeff(), box.high.cwiseAbs().maxCoeff());
}

SimulatedObject::Normals SimulatedObject::normals_at(const RayScene::Hit& hit,
                                                     const Vec3& view_direction) const {
  Normals normals;
  normals.face = face_normal(mesh(), hit.face);
  if (normals.face.dot(view_direction) > 0) normals.face = -normals.face;
  normals.shading = normals.face;
  if (!surface_.smooth) return normals;
  Vec3 sum = Vec3::Zero();
  for (std::size_t k = 0; k < 3; ++k) {
    const auto vertex = static_cast<std::size_t>(mesh().faces[hit.face][k]);
    sum += hit.barycentric[static_cast<Eigen::Index>(k)] * normals_[vertex];
  }
  const double length = sum.norm();
  if (length < 1e-9) return normals;
  normals.shading = sum / length;
  // The interpolated normal belongs to the face's side, not to the viewer's: near the silhouette it
  // may rightly turn away from the viewer.
  if (normals.shading.dot(normals.face) < 0) normals.shading = -normals.shading;
  return normals;
}

bool SimulatedObject::lit(const Vec3& point, const Vec3& face_normal_to_viewer,
                          const Vec3& light) const {
  if ((light - point).dot(face_normal_to_viewer) <= 0) return false;
  return rays_.visible(point + shadow_offset_mm_ * face_normal_to_viewer, light, 0);
}

double SimulatedObject::albedo_at(const Vec3& point) const {
  if (surface_.texture.kind == TextureKind::kNone) return surface_.albedo;
  return surface_.albedo * surface_.texture.factor(object_from_world_ * point);
}

}  // namespace pencilscan
