#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/exchange/brown_fit.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// A device as another program's file describes it.
struct ExchangedDevice {
  Device device;           ///< size 0: the file does not say
  GivenCalibration given;  ///< what the file states of it
  bool is_projector = false;
  std::string source;  ///< the file, for complaints
  /// Another lens model of the file; device.distortion is still to be fitted to it.
  LensModel lens;
};

/// Where the second of two devices stands: second_from_first, as in a stereo calibration.
struct RelativePose {
  std::string first;
  std::string second;
  RigidTransform second_from_first;
};

/// What one or more files of another program say.
struct ExchangedRig {
  std::vector<ExchangedDevice> devices;
  std::vector<RelativePose> relative;
};

struct ExchangeOptions {
  double mm_per_unit = 1;  ///< of the files' lengths, > 0
  bool unit_known = true;  ///< false: the lengths mean nothing ("unit": "unknown")
  /// Largest difference that a device of another lens model may have as Brown-Conrady, px, > 0.
  double worst_lens_px = 0.1;
};

/// Joins what files say to one rig. Devices of `base` with the same name take K, distortion and
/// pose over and keep the rest; others are appended. Poses that are only known relative to a placed
/// device follow; where none is placed, the first device of the first pair is the world.
/// Of a device that several files describe, the first file that states a value counts.
/// InputError when a size is missing, or a lens is unlike the rig's model.
[[nodiscard]] UncalibratedRig join_rig(ExchangedRig files, const UncalibratedRig& base,
                                       const ExchangeOptions& options = {});

/// Scales lengths so that the centres of two placed devices are `mm` apart.
void scale_rig(const std::string& first, const std::string& second, double mm,
               UncalibratedRig& rig);

}  // namespace pencilscan
