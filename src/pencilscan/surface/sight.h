#pragma once

#include "pencilscan/geometry/ray_scene.h"

namespace pencilscan {

/// Keeps a ray's end off the surface it lies on, footprints.
inline constexpr double kOffSurface = 1;

/// Cosine below which a surface is seen too flat for a pixel to say anything of it.
inline constexpr double kLeastSightCosine = 0.02;

/// True when nothing stands between `eye` and the place x of the scene's surface, which shows its
/// front (normal) at a cosine of at least least_cosine.
[[nodiscard]] inline bool sees(const RayScene& scene, const Vec3& eye, const Vec3& x,
                               const Vec3& normal, double least_cosine) {
  if ((eye - x).normalized().dot(normal) < least_cosine) return false;
  return scene.visible(eye, x + kOffSurface * normal, kOffSurface);
}

}  // namespace pencilscan
