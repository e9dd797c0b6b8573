#pragma once

#include <optional>
#include <span>
#include <vector>

#include "pencilscan/depth/depth_map.h"
#include "pencilscan/rig/rig.h"
#include "pencilscan/surface/silhouette.h"
#include "pencilscan/surface/surface.h"
#include "pencilscan/tracking/tracked_surface.h"

namespace pencilscan {

/// A closed surface that came from the moment before.
struct CarriedSurface {
  SurfaceResult surface;
  RigidTransform motion;        ///< since then
  std::vector<float> traveled;  ///< how far each vertex has come, along the surface too; footprints
};

/// How a closed mesh, as coarse as the field and with confidences, fits the depth maps.
[[nodiscard]] SurfaceFit surface_fit(const Rig& rig, std::span<const DepthMap> maps,
                                     const TriangleMesh& mesh);

/// Moves the closed surface of the moment before onto the depth maps of this one. The result is
/// that of close_depth(), without a new Poisson reconstruction. There is no result where the moved
/// surface fits worse than a new one did: where nodes lie together off it, where more of it is
/// invented, or where its triangles have become flat. A jump, a new part or a lost part is
/// therefore reconstructed anew.
[[nodiscard]] std::optional<CarriedSurface> carry_surface(const Rig& rig,
                                                          std::span<const DepthMap> maps,
                                                          const TrackedSurface& before,
                                                          const FusionOptions& options,
                                                          std::span<const Silhouette> silhouettes);

}  // namespace pencilscan
