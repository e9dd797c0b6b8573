#pragma once

#include <vector>

#include "pencilscan/geometry/ray_scene.h"
#include "pencilscan/simulation/surface_texture.h"

namespace pencilscan {

/// Reflection of the whole object.
struct Reflectance {
  double albedo = 0.8;      ///< Lambert, in [0, 1]
  SurfaceTexture texture;   ///< factor on the albedo
  double specular = 0;      ///< weight of the Blinn-Phong lobe (light's own colour), >= 0
  double roughness = 0.03;  ///< exponent of the lobe = 1 / roughness, > 0
  bool smooth = true;       ///< interpolated vertex normals; false: one normal per face
};

/// The object at one moment: mesh in the world, ready for rays. Immutable.
class SimulatedObject {
 public:
  /// `mesh` in its own frame (its texture's frame), at least one face.
  explicit SimulatedObject(const TriangleMesh& mesh, Reflectance surface = {},
                           const RigidTransform& world_from_object = {});

  [[nodiscard]] const RayScene& rays() const { return rays_; }
  [[nodiscard]] const TriangleMesh& mesh() const { return rays_.mesh(); }  ///< in world
  [[nodiscard]] const Reflectance& surface() const { return surface_; }
  [[nodiscard]] const std::vector<Vec3>& normals() const { return normals_; }
  [[nodiscard]] const RigidTransform& world_from_object() const { return world_from_object_; }
  /// Unit normal of a hit's face and the one to shade with, both on the viewer's side.
  struct Normals {
    Vec3 face;
    Vec3 shading;
  };
  [[nodiscard]] Normals normals_at(const RayScene::Hit& hit, const Vec3& view_direction) const;
  /// True when nothing stands between a surface point and a light.
  [[nodiscard]] bool lit(const Vec3& point, const Vec3& face_normal, const Vec3& light) const;
  [[nodiscard]] double albedo_at(const Vec3& point) const;

 private:
  Reflectance surface_;
  RigidTransform world_from_object_;
  RigidTransform object_from_world_;
  RayScene rays_;
  std::vector<Vec3> normals_;  ///< per vertex, world
  double shadow_offset_mm_;    ///< lifts shadow rays off their own face
};

}  // namespace pencilscan
