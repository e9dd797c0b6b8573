#pragma once

#include <array>
#include <span>
#include <vector>

#include "pencilscan/geometry/mesh.h"
#include "pencilscan/tracking/tracked_surface.h"

namespace pencilscan {

/// How many moments the mean of a resting surface goes back. As many come before the first moment
/// of a chunk, so that the mean is the same on both sides of its border.
constexpr int kMemoryMoments = 4;

/// What a moment's surface learns from the one before.
struct Steadied {
  std::vector<float> variance;  ///< per vertex: of its place along the normal; 0: not measured
  RigidTransform motion;        ///< of the whole since the moment before
};

/// Removes the flicker of a surface that rests: there, noise differs from moment to moment while
/// the surface does not. Each measured vertex moves along its normal towards the surface of the
/// moment before, by a Kalman filter whose one state is its place (R. Kalman, A new approach to
/// linear filtering and prediction problems, 1960). The process noise is the larger of how far
/// the surface there has come, along itself too, as registration says (registration.h), and how far
/// the vertices around it moved together, beyond their noise. Where that leaves the filter less
/// than a hundredth of the variance to gain, as in parts that move, vertices stay as measured, and
/// so do vertices that lie farther than `spacing` from the registered surface: they are new.
/// `spacing`: of the depth maps' nodes on the surface; same unit as the mesh. `coarse_faces`: of
/// the mesh's first vertices, before its triangles were cut finer.
[[nodiscard]] Steadied steady_surface(const TrackedSurface& before, double spacing,
                                      std::span<const std::array<int, 3>> coarse_faces,
                                      TriangleMesh& mesh);

/// The variances of a surface without a moment before.
[[nodiscard]] std::vector<float> first_variance(const TriangleMesh& mesh);

}  // namespace pencilscan
