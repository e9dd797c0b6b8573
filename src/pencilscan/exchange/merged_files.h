#pragma once

#include <string>
#include <vector>

#include "pencilscan/exchange/exchanged_device.h"

namespace pencilscan {

/// Devices of the files whose poses have one world, by index.
struct PoseGroup {
  std::vector<std::size_t> devices;
  bool is_stated = false;  ///< files state poses; else pairs alone join the devices
};

/// Two poses that should be the same.
struct PoseDifference {
  double turn_deg = 0;
  double shift = 0;  ///< of the centre, in the unit of the poses
};
[[nodiscard]] PoseDifference difference(const RigidTransform& a, const RigidTransform& b);
/// "12 mm and 1.3 degrees".
[[nodiscard]] std::string difference_text(const PoseDifference& difference,
                                          const std::string& unit);

/// A pose that two files, or two ways along pairs, state differently. Lengths in the files' unit.
struct PoseConflict {
  std::string device;
  std::string seen_from;  ///< a device, or "the world"
  std::string source;     ///< the file that is not followed
  std::string used;       ///< the one that is
  PoseDifference difference;
};

/// Several descriptions of one device become one, and poses follow from each other along pairs.
struct MergedFiles {
  std::vector<ExchangedDevice> devices;  ///< poses in the world of their group, the files' unit
  std::vector<PoseGroup> groups;         ///< that of stated poses first
  std::vector<PoseConflict> conflicts;
  std::vector<std::string> warnings;  ///< other values that differ
};
/// Where two files describe a device, the first one is used and differences are told. InputError
/// where they state different sizes of its picture.
[[nodiscard]] MergedFiles merge_files(ExchangedRig files, const ExchangeOptions& options);

/// The device of this name; null: there is none.
[[nodiscard]] const ExchangedDevice* device_named(const std::vector<ExchangedDevice>& devices,
                                                  const std::string& name);

}  // namespace pencilscan
