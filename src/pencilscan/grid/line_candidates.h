#pragma once

#include <optional>
#include <vector>

#include "pencilscan/geometry/light_sheet.h"
#include "pencilscan/rig/rig.h"
#include "pencilscan/view/color_family.h"

namespace pencilscan {

/// A projected line that a camera pixel may show: where its light sheet meets the pixel's ray.
struct LineCandidate {
  int line = 0;
  double depth = 0;        ///< camera z, mm
  double sigma_depth = 0;  ///< mm, for one projector pixel of error across the line
};

/// Camera depths at which the ray of a pixel is inside the working volume; nothing when it misses
/// it.
struct DepthRange {
  double near = 0;  ///< mm, > 0
  double far = 0;   ///< mm, > near
};
[[nodiscard]] std::optional<DepthRange> depth_range(const Camera& camera, const Sphere& volume,
                                                    const Vec2& pixel);

/// All lines of a pattern that meet the pixel's ray inside the volume, ordered by depth.
[[nodiscard]] std::vector<LineCandidate> line_candidates(const Rig& rig, const Camera& camera,
                                                         const DepthRange& range,
                                                         PatternRef pattern, const Vec2& pixel);

/// False when no surface can face both devices but at a graze: their axes are more than 154 degrees
/// apart.
[[nodiscard]] bool can_see_pattern(const Rig& rig, const Camera& camera, int projector);

/// Per pattern of a family, the negative logarithm of how often a camera sees its lines, 0 for the
/// most frequent one: of a ball's picture a projector lights (1 + cos a) / 2, as of the moon's
/// disc, at the phase angle a of camera and light (Meeus, Astronomical Algorithms, ch. 48).
[[nodiscard]] std::vector<float> phase_costs(const Rig& rig, const Camera& camera,
                                             const ColorFamily& family);

}  // namespace pencilscan
