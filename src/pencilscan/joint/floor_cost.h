#pragma once

#include "pencilscan/joint/piece_labels.h"

namespace pencilscan {

/// The floor term: what a stated floor says of a label. A curve shows either the floor or something
/// above it; both are equally likely beforehand. Depths of the floor scatter about its plane.
/// Depths of anything else lie anywhere in the range. The cost is -log(likelihood with the floor /
/// likelihood without one).
class FloorCost {
 public:
  /// range: of inverse depths. Without a floor nothing costs anything.
  FloorCost(const Rig& rig, const Camera& camera, float range, const JointOptions& options);

  /// ray: (x, y, 1) in the camera's normalised coordinates.
  [[nodiscard]] float operator()(const PieceLabel& label, const Eigen::Vector3f& ray) const;

 private:
  float range_, projection_;
  Eigen::Vector3f normal_ = Eigen::Vector3f::Zero();  ///< inverse depth = normal . (x, y, 1)
  float relative_sigma_ = 0;                          ///< of the floor's inverse depth
};

}  // namespace pencilscan
