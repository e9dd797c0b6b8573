#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "pencilscan/api/reconstruct.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// Distance of the centres of two devices.
struct DeviceDistance {
  std::array<std::string, 2> devices;
  double mm = 0;  ///< > 0
};

struct RigCalibrationOptions {
  std::optional<DeviceDistance> known_distance;  ///< without it or a board: a rig without scale
  std::string board;  ///< in the captures: "chessboard:9x7:75" or "charuco:10x8:75:56:DICT_5X5_100"
  /// How far off given focal lengths may be, one standard deviation in per cent, 0 to 100 (0: they
  /// are exact), and given principal points, px, 0 to 10000; none: as `pencilscan calibrate` has
  /// it.
  std::optional<double> focal_tolerance;
  std::optional<double> center_tolerance;
  std::size_t max_tracks = 0;  ///< surface points to use at most; 0: the default
  std::uint64_t seed = 1;
  StageListener progress;
};

struct CalibratedRig {
  Rig rig;
  std::string verdict;               ///< good, doubtful or unusable
  std::vector<std::string> reasons;  ///< for a verdict that is not good, in plain words
  std::string figures;               ///< JSON text: what `pencilscan calibrate --json` writes
  std::string report;                ///< JSON text: calibration.json
};

/// The rig from Gray-code captures (docs/formats.md), one folder per pose of the object. As
/// `pencilscan calibrate`. A rig whose verdict is unusable is not to be used. InputError for
/// folders that do not fit the devices.
[[nodiscard]] CalibratedRig calibrate_rig(const UncalibratedRig& devices,
                                          const std::vector<std::filesystem::path>& captures,
                                          const RigCalibrationOptions& options = {});

}  // namespace pencilscan
