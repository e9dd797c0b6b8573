#pragma once

#include <optional>
#include <string>

#include "pencilscan/rig/rig.h"

// Poses and intrinsics that follow another convention than rig.json: X_device = R X_world + t, K in
// pixels. What comes of them looks like a bad calibration, or like a result.

namespace pencilscan {

/// Where hardly any device looks at the place that they have in common, and nearly all would if R
/// and t were camera-to-world, t the devices' centres, or devices looked along -z: that, and what
/// the file wants.
[[nodiscard]] std::optional<std::string> pose_convention_warning(const Rig& rig);

/// A device that sees more than 150 degrees by its focal length, or a camera whose principal point
/// lies at its picture's rim: K is in pixels. A lens that is no lens: coefficients in another order
/// than OpenCV's, or of another model.
[[nodiscard]] std::optional<std::string> intrinsics_convention_warning(const Rig& rig);

/// Two devices in the same place that look the same way: one's calibration was given to both.
[[nodiscard]] std::optional<std::string> shared_pose_warning(const Rig& rig);

}  // namespace pencilscan
