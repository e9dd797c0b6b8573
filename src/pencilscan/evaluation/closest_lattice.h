#pragma once

#include <array>
#include <vector>

#include "pencilscan/geometry/ray_scene.h"

namespace pencilscan {

/// The closest points of a surface, looked up instead of searched for: each node of a lattice over
/// the surface and a quarter of its diagonal around it knows its own. A place is answered with that
/// of the nearest node, so a closest point may be off by a step of the lattice and more; the plane
/// through it is the surface's.
class ClosestLattice {
 public:
  struct Node {
    Vec3 point = Vec3::Zero();   ///< on the surface
    Vec3 normal = Vec3::Zero();  ///< of its facet, unit
  };

  /// The surface has faces.
  explicit ClosestLattice(const RayScene& surface);

  /// Of a place beyond the lattice, that of its nearest node.
  [[nodiscard]] const Node& nearest(const Vec3& place) const;
  [[nodiscard]] double step_mm() const { return step_mm_; }

 private:
  Vec3 low_ = Vec3::Zero();
  double step_mm_ = 1;
  std::array<int, 3> count_ = {};
  std::vector<Node> nodes_;
};

}  // namespace pencilscan
