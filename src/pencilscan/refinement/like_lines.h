#pragma once

#include <vector>

#include "pencilscan/grid/grid_graph.h"
#include "pencilscan/rig/rig.h"
#include "pencilscan/view/color_family.h"

namespace pencilscan {

/// Whether curves may hold the light of two lines. Lines of two projectors with like colours that
/// run side by side in a picture make one curve, which lies between them, on neither.
class LikeLines {
 public:
  explicit LikeLines(const Rig& rig) : rig_(rig), families_(color_families(rig)) {}

  /// A curve as a crossing shows it.
  struct NamedCurve {
    PatternRef pattern;
    double coordinate_px = 0;     ///< of its line in the projector
    Vec2 normal = Vec2::UnitX();  ///< of the curve, unit
  };

  /// True where the projectors throw a line along a named curve at its crossing with another one,
  /// so near that the profiles touch. The tangents of both curves give the surface's tangent plane
  /// there. False where they give none.
  [[nodiscard]] bool may_touch(const Camera& camera, const Vec2& pixel, const NamedCurve& curve,
                               const NamedCurve& other) const;

 private:
  const Rig& rig_;
  std::vector<ColorFamily> families_;
};

}  // namespace pencilscan
