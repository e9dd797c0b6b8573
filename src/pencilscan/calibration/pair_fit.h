#pragma once

#include <cstdint>
#include <vector>

#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/calibration/pair_matches.h"

namespace pencilscan {

/// How well correspondences agree with devices: whether the rays of a camera and a projector lie in
/// one plane, and meet in front of both.
class PairFit {
 public:
  /// `tolerance_px`: of the projector's ray off the epipolar plane, in its pixels.
  PairFit(const std::vector<BundleDevice>& devices, double tolerance_px);

  [[nodiscard]] bool placed(std::size_t d) const { return devices_[d].present; }
  /// Whether both devices have a pose that explains the match.
  [[nodiscard]] bool explains(const DevicePair& pair, const PairMatch& match) const;
  /// Share of matches that are explained, if taken as those of the given devices.
  [[nodiscard]] double share(const std::vector<PairMatch>& matches, std::size_t camera,
                             std::size_t projector, std::size_t* count = nullptr,
                             std::size_t capture = SIZE_MAX) const;

 private:
  std::vector<BundleDevice> devices_;
  std::vector<Mat3> world_from_;
  double tolerance_px_;
};

}  // namespace pencilscan
