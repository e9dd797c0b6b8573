#include "pencilscan/bundle/priors.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/rig/device_list.h"

namespace pencilscan {

namespace {

/// Square of the distance of the farthest corner of the image from the principal point, over the
/// focal length.
double corner_radius2(const Device& device) {
  const double x = std::max(device.K(0, 2), device.width - 1 - device.K(0, 2)) / device.K(0, 0);
  const double y = std::max(device.K(1, 2), device.height - 1 - device.K(1, 2)) / device.K(1, 1);
  return x * x + y * y;
}

/// Deviations of a K that is known, and of the distortion that came with it.
void set_tolerance(const GivenCalibration& known, const GivenTolerance& tolerance,
                   const Device& device, BundleDevice& bundle) {
  auto& sigma = bundle.prior_sigma;
  sigma[kFx] = tolerance.focal * bundle.inner[kFx];
  sigma[kFy] = std::min(sigma[kFy], tolerance.focal);
  sigma[kCx] = sigma[kCy] = tolerance.center_px;
  if (!known.distortion) return;
  // A corner at r moves by k1 r^2, k2 r^4 and up to 3 p r of its distance.
  const double r2 = corner_radius2(device);
  sigma[kK1] = std::min(sigma[kK1], tolerance.focal / r2);
  sigma[kK2] = std::min(sigma[kK2], tolerance.focal / (r2 * r2));
  sigma[kP1] = sigma[kP2] = std::min(sigma[kP1], tolerance.focal / (3 * std::sqrt(r2)));
}

}  // namespace

void set_priors(const GivenCalibration& known, const std::optional<GivenTolerance>& tolerance,
                bool is_camera, const Device& device, BundleDevice& bundle) {
  const double width = device.width;
  const double height = device.height;
  auto& value = bundle.prior;
  auto& sigma = bundle.prior_sigma;
  value[kFx] = bundle.inner[kFx];
  value[kFy] = known.K ? bundle.inner[kFy] / bundle.inner[kFx] : 1;
  value[kCx] = known.K ? bundle.inner[kCx] : (width - 1) / 2;
  value[kCy] = known.K ? bundle.inner[kCy] : (height - 1) / 2;
  // Without a given focal length its prior only keeps it from running away.
  sigma[kFx] = (known.K ? 0.1 : 0.5) * bundle.inner[kFx];
  sigma[kFy] = is_camera ? 0.002 : 0.02;
  sigma[kCx] = (is_camera ? 0.02 : 0.04) * width;
  sigma[kCy] = (is_camera ? 0.02 * width : (known.K ? 0.1 : 0.5) * height);
  for (std::size_t i = kK1; i < kIntrinsics; ++i) value[i] = known.distortion ? bundle.inner[i] : 0;
  sigma[kK1] = 0.2;
  sigma[kK2] = 0.5;
  sigma[kP1] = sigma[kP2] = 0.002;
  sigma[kK3] = 0;
  if (known.K && tolerance) set_tolerance(known, *tolerance, device, bundle);
}

void hold_given(const GivenCalibration& known, BundleDevice& bundle) {
  if (known.K)
    for (const std::size_t i : {kFx, kFy, kCx, kCy}) bundle.prior_sigma[i] = 0;
  if (known.distortion)
    for (const std::size_t i : {kK1, kK2, kP1, kP2, kK3}) bundle.prior_sigma[i] = 0;
}

double unmodelled_k3(const Device& device) {
  constexpr double kShare = 5e-4;
  return kShare / std::pow(corner_radius2(device), 3);
}

void expect_unmodelled(const Rig& sizes, BundleProblem& problem) {
  for (std::size_t d = 0; d < problem.devices.size(); ++d) {
    BundleDevice& bundle = problem.devices[d];
    if (!bundle.present || bundle.prior_sigma[kK1] == 0) continue;
    Device device = device_at(sizes, d);
    set_device(bundle, device);
    bundle.prior_sigma[kK3] = unmodelled_k3(device);
  }
}

}  // namespace pencilscan
