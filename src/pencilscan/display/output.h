#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/core/fault.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// A video output of this computer, as the X server (RandR) describes it. Lengths in px.
struct DisplayOutput {
  std::string name;     ///< "HDMI-1"
  std::string monitor;  ///< what the display calls itself (EDID); may be empty
  bool connected = false;
  bool lit = false;  ///< sends a picture: what follows holds
  int x = 0;         ///< place on the desktop
  int y = 0;
  int width = 0;  ///< size on the desktop
  int height = 0;
  int mode_width = 0;  ///< what is sent
  int mode_height = 0;
  int native_width = 0;  ///< what the display prefers; 0: it does not say
  int native_height = 0;
  double refresh_hz = 0;  ///< 0: unknown
  bool interlaced = false;
  bool turned = false;  ///< rotated or reflected
  bool scaled = false;  ///< by the graphics card

  friend bool operator==(const DisplayOutput&, const DisplayOutput&) = default;
};

/// An output with the projector that it feeds.
struct OutputUse {
  const Projector* projector = nullptr;
  const DisplayOutput* output = nullptr;
};

/// Refresh rates that differ by more than this share beat visibly within the exposure of a picture:
/// over 100 refreshes, half of one.
inline constexpr double kRefreshTolerance = 0.005;

/// Why outputs cannot show their projectors' pictures pixel by pixel; empty: they can.
///   no_signal: not connected, or not lit    size: the mode is not the size of the panel
///   not_native: the display scales          turned, scaled, interlaced
///   mirrored: another output shows a part of the same desktop
///   refresh: two projectors differ, so that no exposure fits both
[[nodiscard]] std::vector<Fault> output_faults(std::span<const OutputUse> uses,
                                               std::span<const DisplayOutput> outputs);

/// The output of every projector: that of `named` ("proj0" -> "HDMI-1") or else of the rig.
/// InputError when a projector has none, one is not there, two share one, or `named` knows a
/// projector that the rig does not. For the message: `source`, the rig's file, and `lab`, the
/// lab.json of `named`; empty: the option --output.
[[nodiscard]] std::vector<OutputUse> uses_of(const Rig& rig, std::span<const DisplayOutput> outputs,
                                             const std::map<std::string, std::string>& named,
                                             const std::string& source,
                                             const std::string& lab = {});

}  // namespace pencilscan
