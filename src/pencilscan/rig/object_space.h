#pragma once

#include <optional>

#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// Distance of neighbouring light sheets at the volume's centre, in the rig's unit: the median over
/// the patterns; 0 without any.
[[nodiscard]] double line_spacing(const Rig& rig);
/// Likewise how wide a line is there.
[[nodiscard]] double line_width(const Rig& rig);
/// What a length at the volume's centre, square to the line of sight, covers on a device, px.
[[nodiscard]] double pixels_at_center(const Rig& rig, const Device& device, double length);

/// Where the object can be: in the volume, with a margin, and more than a line spacing above the
/// floor where the rig states one.
class ObjectSpace {
 public:
  explicit ObjectSpace(const Rig& rig, double volume_margin = 1.1);

  /// The same, with the floor and what is below it.
  [[nodiscard]] ObjectSpace with_floor() const {
    ObjectSpace space = *this;
    space.floor_.reset();
    return space;
  }

  [[nodiscard]] const std::optional<Floor>& floor() const { return floor_; }

  [[nodiscard]] bool holds(const Vec3& x) const {
    return (x - volume_.center).norm() <= volume_.radius &&
           (!floor_ || floor_->height(x) > least_height_);
  }

 private:
  Sphere volume_;  ///< margin included
  std::optional<Floor> floor_;
  double least_height_;
};

}  // namespace pencilscan
