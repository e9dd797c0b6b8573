#pragma once

#include <array>
#include <span>
#include <vector>

#include "pencilscan/depth/depth_map.h"
#include "pencilscan/geometry/ray_scene.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

struct HoleOptions {
  double least_spacing_px = 3;  ///< lines closer together in the image are not resolved, > 0
  double least_cosine = 0.2;    ///< of the incidence to camera and projector, in (0, 1)
};

struct HoleReport {
  /// Per depth map: nodes by HoleReason.
  std::vector<std::array<std::size_t, kHoleReasons>> nodes;
  /// Area of the closed mesh by HoleReason, mm^2 (kBackground stays 0).
  std::array<double, kHoleReasons> area_mm2{};
  std::vector<HoleReason> vertices;  ///< per vertex of the mesh
};

/// Why is there no depth on `surface`, the closed mesh? Nodes without depth whose camera rays meet
/// the closed mesh, and vertices that nobody measured (confidence 0), get the first reason that
/// holds:
///   contradicted, saturated   as the depth stage found in that camera,
///   no projector              nothing lights the place: shadow, or turned away,
///   too compressed            its lines are too close together in the image, or it is seen at a
///                             grazing angle,
///   one projector             a single one lights it with lines that the camera resolves,
///   ambiguous                 several do, and yet no depth was accepted.
/// A vertex takes the most hopeful reason (the last in this order) of the cameras that see it;
/// kNotSeen when none does. The mesh casts the shadows: where it was invented it may be wrong, and
/// so may the reason.
[[nodiscard]] HoleReport explain_holes(const Rig& rig, const RayScene& surface,
                                       std::span<DepthMap> maps, const HoleOptions& options = {});

/// Vertices (1 in `which`) that nobody measured after all have this reason.
void give_reason(const TriangleMesh& mesh, std::span<const char> which, HoleReason reason,
                 HoleReport& report);

[[nodiscard]] const char* to_string(HoleReason reason);

}  // namespace pencilscan
