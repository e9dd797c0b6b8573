#include "pencilscan/rig/object_space.h"

#include <utility>
#include <vector>

#include "pencilscan/core/median.h"

namespace pencilscan {

double line_spacing(const Rig& rig) {
  const Vec3 center = working_volume(rig).center;
  std::vector<double> spacings;
  for (const Projector& projector : rig.projectors) {
    const double distance = (projector.center() - center).norm();
    for (const LinePattern& pattern : projector.patterns) {
      const auto axis = static_cast<Eigen::Index>(pattern.axis);
      spacings.push_back(pattern.pitch_px * distance / projector.K(axis, axis));
    }
  }
  return spacings.empty() ? 0 : upper_median(std::move(spacings));
}

ObjectSpace::ObjectSpace(const Rig& rig, double volume_margin)
    : volume_(working_volume(rig)), floor_(rig.floor), least_height_(line_spacing(rig)) {
  volume_.radius *= volume_margin;
}

}  // namespace pencilscan
