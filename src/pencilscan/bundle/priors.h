#pragma once

#include <optional>

#include "pencilscan/bundle/bundle.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// How far off given values may be, one standard deviation; 0: they are exact.
struct GivenTolerance {
  static constexpr double kMostFocal = 1;  ///< what may be stated
  static constexpr double kMostCenterPx = 10000;
  double focal = 0.005;  ///< of fx and fy over themselves, >= 0
  double center_px = 5;  ///< of cx and cy, >= 0
};

/// What is plausible of a device of which nothing was given: lenses have their principal point near
/// the centre and square pixels; projectors shift the lens upwards by up to the image's height, and
/// panels may be stretched. A given K is off by the tolerance; given distortion displaces the
/// farthest corner of the image by that share of its distance from the principal point. Without a
/// tolerance given values are rough: a start that any data overrule. Values in, standard deviations
/// out.
void set_priors(const GivenCalibration& known, const std::optional<GivenTolerance>& tolerance,
                bool is_camera, BundleDevice& device);

/// One standard deviation of k3. Lenses that compress angles have one: the equidistant projection
/// f theta has -1/7 in the series of tan theta, the stereographic one, 2 f tan(theta / 2), -5/64.
/// And what the model leaves out displaces the corner of the image that lies farthest from the
/// principal point by half a thousandth of its distance (lenses: a few tenths of a pixel). k3
/// displaces that corner by no more than k1 may, of which given distortion says more.
[[nodiscard]] double usual_k3(const BundleDevice& device);
/// Sets it for devices whose distortion is not held, from their focal lengths so far.
void expect_k3(BundleProblem& problem);

}  // namespace pencilscan
