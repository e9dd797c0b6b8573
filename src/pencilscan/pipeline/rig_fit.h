#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/pipeline/rig_explanation.h"
#include "pencilscan/pipeline/rig_refinement.h"
#include "pencilscan/refinement/moved_devices.h"

namespace pencilscan {

/// Does a rig still fit what its devices see? From the best answer to the worst: with a device put
/// back, a rig is known again.
enum class RigVerdict {
  kFits,
  kOneMoved,  ///< one device has to be put back
  kSeveralMoved,
  kUnknown,      ///< too few crossings, of the rig or of a device
  kUnexplained,  ///< crossings miss each other, and no device put back helps; or names are wrong
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
  double seen_from_px = 0;    ///< DeviceMove
  /// Crossings show a move only where it is farther than half a line spacing on its image, which
  /// names show: one along the lines that it sees, or shows, may not show at all.
  bool may_have_moved_unseen = false;
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

/// A figure of a report, px or mm, in thousandths; 0 where it is not known.
[[nodiscard]] double thousandth(double value);

[[nodiscard]] nlohmann::ordered_json rig_fit_json(const RigFit& fit);

}  // namespace pencilscan
