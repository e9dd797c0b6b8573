#include "pencilscan/joint/floor_cost.h"

#include <cmath>
#include <numbers>

#include "pencilscan/rig/object_space.h"

namespace pencilscan {

FloorCost::FloorCost(const Rig& rig, const Camera& camera, float range, const JointOptions& options)
    : range_(range), projection_(static_cast<float>(options.projection_sigma_px)) {
  // Deviation of a floor from the stated plane, line spacings: a tenth of what ObjectSpace keeps
  // clear of it.
  constexpr double kFloorSpacings = 0.1;
  if (!rig.floor) return;
  const double height = -rig.floor->height(camera.center());
  if (!(height < 0)) return;  // the camera is below: it does not see the floor
  normal_ = (camera.device_from_world.rotation * rig.floor->normal / height).cast<float>();
  relative_sigma_ = static_cast<float>(kFloorSpacings * line_spacing(rig) / -height);
}

float FloorCost::operator()(const PieceLabel& label, const Eigen::Vector3f& ray) const {
  const float floor = normal_.dot(ray);
  if (!(floor > 0)) return 0;
  const float deviation =
      std::hypot(projection_ * label.inverse_depth_per_px, relative_sigma_ * floor);
  const float off = (label.q.dot(ray) - floor) / deviation;
  const float density =
      std::exp(-0.5F * off * off) / (std::sqrt(2 * std::numbers::pi_v<float>) * deviation);
  return -std::log1p(range_ * density);
}

}  // namespace pencilscan
