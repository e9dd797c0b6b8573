#include "pencilscan/bundle/priors.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/bundle/bundle_device.h"

namespace pencilscan {

namespace {

/// Square of the distance of the farthest corner of the image from the principal point, over the
/// focal length.
double corner_radius2(const BundleDevice& device) {
  const auto& inner = device.inner;
  const double x = std::max(inner[kCx], device.width - 1 - inner[kCx]) / inner[kFx];
  const double y = std::max(inner[kCy], device.height - 1 - inner[kCy]) / inner[kFy];
  return x * x + y * y;
}

/// Deviations of a K that is known, and of the distortion that came with it.
void set_tolerance(const GivenCalibration& known, const GivenTolerance& tolerance,
                   BundleDevice& device) {
  auto& sigma = device.prior_sigma;
  sigma[kFx] = tolerance.focal * device.inner[kFx];
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
                bool is_camera, BundleDevice& device) {
  const double width = device.width;
  const double height = device.height;
  auto& value = device.prior;
  auto& sigma = device.prior_sigma;
  value[kFx] = device.inner[kFx];
  value[kFy] = known.K ? device.inner[kFy] / device.inner[kFx] : 1;
  value[kCx] = known.K ? device.inner[kCx] : (width - 1) / 2;
  value[kCy] = known.K ? device.inner[kCy] : (height - 1) / 2;
  // Without a given focal length its prior only keeps it from running away.
  sigma[kFx] = (known.K ? 0.1 : 0.5) * device.inner[kFx];
  sigma[kFy] = is_camera ? 0.002 : 0.02;
  sigma[kCx] = (is_camera ? 0.02 : 0.04) * width;
  sigma[kCy] = (is_camera ? 0.02 * width : (known.K ? 0.1 : 0.5) * height);
  for (std::size_t i = kK1; i < kIntrinsics; ++i) value[i] = known.distortion ? device.inner[i] : 0;
  sigma[kK1] = 0.2;
  sigma[kK2] = 0.5;
  sigma[kP1] = sigma[kP2] = 0.002;
  device.is_K_given = known.K && tolerance;
  if (device.is_K_given) set_tolerance(known, *tolerance, device);
  sigma[kK3] = usual_k3(device);
}

double usual_k3(const BundleDevice& device) {
  constexpr double kOfProjections = 0.1;
  constexpr double kCornerShare = 5e-4;
  const double r2 = corner_radius2(device);
  const double usual = std::hypot(kOfProjections, kCornerShare / (r2 * r2 * r2));
  return std::min(usual, device.prior_sigma[kK1] / (r2 * r2));
}

void expect_k3(BundleProblem& problem) {
  for (BundleDevice& device : problem.devices)
    if (device.present) device.prior_sigma[kK3] = usual_k3(device);
}

}  // namespace pencilscan
