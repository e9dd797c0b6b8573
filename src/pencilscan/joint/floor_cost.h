#pragma once

#include "pencilscan/joint/piece_labels.h"

namespace pencilscan {

/// The floor term: what a stated floor says of a label. A curve shows the floor or anything above
/// it; depths of what shows the floor scatter about the plane, all others are anywhere in the
/// range. The cost is the negative logarithm of that likelihood over the one without a floor, both
/// being as likely as not.
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
