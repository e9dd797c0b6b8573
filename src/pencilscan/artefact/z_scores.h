#pragma once

#include <cstddef>
#include <functional>
#include <optional>

#include "pencilscan/artefact/artefact_points.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// What the points say of their own error, against the error that they have: z = error / sigma.
struct ZScores {
  std::size_t count = 0;   ///< points with sigma > 0
  std::size_t missed = 0;  ///< whose camera ray misses the artefact: |z| counts as infinite
  double below_1 = 0;      ///< share with |z| < 1; ideal 0.683
  double below_2 = 0;      ///< 0.954
  double below_3 = 0;      ///< 0.997
  double rms = 0;          ///< of those that do not miss; ideal 1
  double greatest = 0;     ///< |z|, of those that do not miss
};

/// Error of a point: along the ray from the camera at `center`, or normal to the surface without
/// one; nothing when the ray misses the surface. mm
using SurfaceError =
    std::function<std::optional<double>(const Vec3& point, const std::optional<Vec3>& center)>;

/// Nothing when the points have no sigma, or one along camera rays (points.ply) and there is no rig
/// that says where the cameras are.
[[nodiscard]] std::optional<ZScores> z_scores(const ArtefactPoints& points, const Rig* rig,
                                              const SurfaceError& error);

/// Signed distance along the ray from `center` through `point`, from the nearest of its hits on the
/// sphere to the point; nothing when it misses.
[[nodiscard]] std::optional<double> error_along_ray(const Sphere& sphere, const Vec3& point,
                                                    const Vec3& center);

}  // namespace pencilscan
