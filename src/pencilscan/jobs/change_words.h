#pragma once

#include <string>

#include "pencilscan/jobs/changes.h"

namespace pencilscan {

// What is said of the figures that watch.h watches, by their kind.

/// Of crossings, as the kind "crossings"; its direction says nothing.
inline constexpr const char* kShift = "shift";

/// Three digits, and those of larger numbers before the point.
[[nodiscard]] std::string in_words(double value);

/// Of kinds without a unit.
[[nodiscard]] bool is_of_light(const std::string& kind);

/// The figures now and before; of light the share.
[[nodiscard]] std::string from_to(const std::string& kind, const Change& change);

/// The beginning of a sentence that from_to() ends.
[[nodiscard]] std::string quantity(const std::string& kind);

/// What a change of one figure of one device, or of that figure in all cameras, usually comes from.
struct CauseClues {
  bool up = false;
  bool all = false;        ///< devices of the kind
  bool lines_too = false;  ///< the light on lines rose as well
  bool is_spread = false;  ///< the light on lines fell, and pictures stay as bright
};
[[nodiscard]] std::string usual_cause(const std::string& kind, const CauseClues& clues);

}  // namespace pencilscan
