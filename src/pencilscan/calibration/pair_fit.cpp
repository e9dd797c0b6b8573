#include "pencilscan/calibration/pair_fit.h"

#include <cmath>

namespace pencilscan {

PairFit::PairFit(const std::vector<BundleDevice>& devices, double tolerance_px)
    : devices_(devices), tolerance_px_(tolerance_px) {
  for (const BundleDevice& device : devices_)
    world_from_.push_back(rotation_of(device).transpose());
}

bool PairFit::explains(const DevicePair& pair, const PairMatch& match) const {
  const BundleDevice& c = devices_[pair.first];
  const BundleDevice& p = devices_[pair.second];
  if (!c.present || !p.present) return false;
  const Vec3 baseline = (center_of(p) - center_of(c)).normalized();
  const Vec3 a = (world_from_[pair.first] * device_ray(c, match.in_camera)).normalized();
  const Vec3 b = (world_from_[pair.second] * device_ray(p, match.in_projector)).normalized();
  const Vec3 normal = baseline.cross(a);
  const bool is_near = std::abs(normal.normalized().dot(b)) * p.inner[kFx] < tolerance_px_;
  // On one side of the baseline, and nearing each other away from it.
  const bool is_in_front = normal.dot(baseline.cross(b)) > 0 && baseline.dot(a) > baseline.dot(b);
  return is_near && is_in_front;
}

double PairFit::share(const std::vector<PairMatch>& matches, std::size_t camera,
                      std::size_t projector, std::size_t* count, std::size_t capture) const {
  std::size_t all = 0;
  std::size_t near = 0;
  for (const PairMatch& m : matches) {
    if (capture != SIZE_MAX && m.capture != capture) continue;
    ++all;
    near += explains({camera, projector}, m) ? 1U : 0U;
  }
  if (count != nullptr) *count = all;
  return all == 0 ? 1 : static_cast<double>(near) / static_cast<double>(all);
}

}  // namespace pencilscan
