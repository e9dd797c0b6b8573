#pragma once

#include <span>

#include "pencilscan/detection/curve.h"
#include "pencilscan/detection/profile_fit.h"

namespace pencilscan {

/// The fit of one profile; as in ProfileFits.
struct ProfileFit {
  float amplitude = 0;
  float offset = 0;
  float width = 0;
  float residual2 = 0;
  float offset_gain = 0;
  bool good = false;
};
[[nodiscard]] ProfileFit fit_of(const ProfileFits& fits, int lane);

/// Moves the points of a curve to their fits, where these are good, and sets what was fitted. The
/// residual level of one profile has few degrees of freedom: sigma has the mean within six points.
void take_fits(std::span<const ProfileFit> fits, std::span<CurvePoint> points);

}  // namespace pencilscan
