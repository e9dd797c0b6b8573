#pragma once

#include <string>

#include "pencilscan/calibration/verdict.h"

namespace pencilscan {

/// What to do where a plane is not enough.
inline constexpr const char* kLeaveThePlane =
    "capture an object with depth, or the plane in several poses that differ in tilt (one "
    "--captures each)";

/// How much of a captured scene is one plane, and what findings say of that.
struct FlatScene {
  double share = 0;             ///< of the correspondences of all pairs
  bool is_mostly_flat = false;  ///< enough of them to be the reason where a rig is known weakly

  [[nodiscard]] std::string text() const;
  /// Why a rig is known weakly, to follow what is known weakly; may be empty.
  [[nodiscard]] std::string reason() const;
  /// What helps: what is `usual`, or to leave the plane.
  [[nodiscard]] std::string advice(const std::string& usual) const;
};
[[nodiscard]] FlatScene flat_scene(const CalibrationResult& result, const VerdictOptions& options);

}  // namespace pencilscan
