#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/pipeline/rig_explanation.h"
#include "pencilscan/pipeline/rig_refinement.h"
#include "pencilscan/refinement/moved_devices.h"

namespace pencilscan {

/// Does a rig still fit what its devices see?
enum class RigVerdict {
  kFits,
  kOneMoved,  ///< one device has to be put back
  kSeveralMoved,
  kUnexplained,  ///< crossings miss each other, and no device put back helps; or names are wrong
  kUnknown,      ///< too few crossings, of the rig or of a device
};

[[nodiscard]] const char* to_string(RigVerdict verdict);

struct DeviceFit {
  std::string name;
  bool is_projector = false;
  CrossingDisagreement crossings;  ///< that it takes part in, the rig as given
  double shift_px = 0;             ///< how far it alone would have to be put back (DeviceMove)
  double sigma_px = 0;
  bool has_moved = false;
  bool is_told = true;        ///< what is named of it is enough to judge it by
  double rotation_px = 0;     ///< where it has moved, with the others that have
  double translation_mm = 0;  ///< the same
};

/// "camera cam1"
[[nodiscard]] std::string full_name(const DeviceFit& device);

struct RigFit {
  RigVerdict verdict = RigVerdict::kUnknown;
  std::string text;  ///< in plain words
  std::size_t frames = 0;
  double labelled_share = 0;       ///< of the curves' points
  CrossingDisagreement before;     ///< the rig as given
  CrossingDisagreement after;      ///< with what moved put back
  std::vector<DeviceFit> devices;  ///< cameras, then projectors
  /// Devices of which names say more than crossings do: most curves of a camera, or the lines of a
  /// projector's colours, have none, or colours speak against them. In plain words; empty: none.
  std::string doubt;
  Rig put_back;  ///< the rig with what moved put back
};

/// What is said of a rig (in footprints: in_footprints(stated)) whose frames are explained.
[[nodiscard]] RigFit fit_of(const Rig& stated, const Rig& rig, const Explanation& explained);

/// Looks at the crossings of labelled lines of some frames (joint labels, made with corrected
/// devices where the rig is off: line_naming.h) and finds the fewest devices that moved
/// (moved_devices.h).
[[nodiscard]] RigFit check_rig_on_frames(const Rig& rig, std::span<const FrameCurves> frames,
                                         const MovedDevicesOptions& options = {});

/// A figure of a report, px or mm, in thousandths; 0 where it is not known.
[[nodiscard]] double thousandth(double value);

[[nodiscard]] nlohmann::ordered_json rig_fit_json(const RigFit& fit);

}  // namespace pencilscan
