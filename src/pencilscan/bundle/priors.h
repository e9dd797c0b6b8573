#pragma once

#include "pencilscan/bundle/bundle.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// What is plausible of a device of which nothing was given: lenses have their principal point near
/// the centre and square pixels; projectors shift the lens upwards by up to the image's height, and
/// panels may be stretched. Given values are taken as rough. Values in, standard deviations out.
void set_priors(const GivenCalibration& known, bool is_camera, const Device& device,
                BundleDevice& bundle);
/// Holds what was given at its value.
void hold_given(const GivenCalibration& known, BundleDevice& bundle);

/// One standard deviation of k3, which nobody estimates: what the model's polynomial leaves out
/// displaces the corner of the image that lies farthest from the principal point by half a
/// thousandth of its distance (lenses: a few tenths of a pixel).
[[nodiscard]] double unmodelled_k3(const Device& device);
/// Sets it for devices whose distortion is not held, from their focal lengths so far.
void expect_unmodelled(const Rig& sizes, BundleProblem& problem);

}  // namespace pencilscan
