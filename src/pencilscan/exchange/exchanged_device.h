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
  std::string source;  ///< the file, for complaints
};

/// What one or more files of another program say.
struct ExchangedRig {
  std::vector<ExchangedDevice> devices;
  std::vector<RelativePose> relative;
  bool world_is_arbitrary = false;  ///< poses are right to each other alone (COLMAP)
};

/// Two placed devices of the files, and how far their centres are apart.
struct StatedDistance {
  std::string first;
  std::string second;
  double mm = 1;  ///< > 0
};

struct ExchangeOptions {
  double mm_per_unit = 1;  ///< of the files' lengths, > 0
  bool unit_known = true;  ///< false: the lengths mean nothing ("unit": "unknown")
  std::optional<StatedDistance> known_distance;  ///< counts before mm_per_unit
  /// Largest difference that a device of another lens model may have as Brown-Conrady, px, > 0.
  double worst_lens_px = 0.1;
  // Poses that should be the same may differ by so much before it is told: calibrations of pairs
  // differ by some tenths of a degree and of a per cent.
  double most_turn_deg = 0.5;      ///< > 0
  double most_shift_share = 0.01;  ///< of the distance of the devices, > 0
};

/// What files and base make together.
struct JoinedRig : UncalibratedRig {
  std::vector<std::string> notes;     ///< what was concluded, one sentence each
  std::vector<std::string> warnings;  ///< what contradicts itself, likewise
};

/// --size: the image size of a device whose files lack it. InputError of the command line where
/// there is no such device, or a file states another size.
void state_size(const std::string& name, int width, int height, ExchangedRig& rig);

/// Joins what files say to one rig. Devices of `base` with the same name take K, distortion and
/// pose over and keep the rest; others are appended.
///
/// Poses that are only known relative to a placed device follow; where none is placed, the first
/// device of the first pair is the world. Of a device that several files describe, the first file
/// that states a value counts; other values are warned of, other image sizes are an InputError.
///
/// What stays of the base (devices that the files do not place, volume, floor) keeps its lengths:
/// only what the files place is multiplied. Where the files have no unit, devices that both place
/// give the scale. Pairs, and files whose world is arbitrary, are moved so that most
/// of these devices stand where the base has them.
///
/// InputError when a size is missing, a lens is unlike the rig's model, or lengths of files and
/// base would mix whose ratio nobody knows.
[[nodiscard]] JoinedRig join_rig(ExchangedRig files, const UncalibratedRig& base,
                                 const ExchangeOptions& options = {});

}  // namespace pencilscan
