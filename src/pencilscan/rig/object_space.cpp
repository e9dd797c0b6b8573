#include "pencilscan/rig/object_space.h"

#include <utility>
#include <vector>

#include "pencilscan/core/median.h"
#include "pencilscan/rig/view_of_volume.h"

namespace pencilscan {

namespace {

/// The median over the patterns of a length on the panel, as the volume's centre sees it.
double length_at_center(const Rig& rig, double LinePattern::*length_px) {
  const Sphere volume = working_volume(rig);
  std::vector<double> lengths;
  for (const Projector& projector : rig.projectors) {
    const double distance = viewing_distance(projector, volume);
    for (const LinePattern& pattern : projector.patterns) {
      const auto axis = static_cast<Eigen::Index>(pattern.axis);
      lengths.push_back(pattern.*length_px * distance / projector.K(axis, axis));
    }
  }
  return lengths.empty() ? 0 : upper_median(std::move(lengths));
}

}  // namespace

double line_spacing(const Rig& rig) { return length_at_center(rig, &LinePattern::pitch_px); }
double line_width(const Rig& rig) { return length_at_center(rig, &LinePattern::line_width_px); }

double pixels_at_center(const Rig& rig, const Device& device, double length) {
  return length * device.focal_px() / viewing_distance(device, working_volume(rig));
}

ObjectSpace::ObjectSpace(const Rig& rig, double volume_margin)
    : volume_(working_volume(rig)), floor_(rig.floor), least_height_(line_spacing(rig)) {
  volume_.radius *= volume_margin;
}

}  // namespace pencilscan
