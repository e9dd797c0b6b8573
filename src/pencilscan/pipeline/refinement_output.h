#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "pencilscan/pipeline/rig_refinement.h"

namespace pencilscan {

/// What a reader needs to know of a refinement; refinement.json has it all.
struct RefinementOutcome {
  bool refined = false;
  bool resumed = false;  ///< was there already, from the same inputs
  std::string reason;    ///< why not refined, in plain words
  double before_px = 0;  ///< median disagreement of the crossings with the rig as given ...
  double after_px = 0;   ///< ... and as refined
  std::vector<std::string> moves;  ///< of every device, in plain words
  std::vector<std::string> warnings;
};

/// refinement.json: counts, residuals before and after, what moved, warnings (docs/formats.md).
[[nodiscard]] nlohmann::ordered_json refinement_report(const RigRefinement& refinement,
                                                       const std::vector<std::string>& frames);
[[nodiscard]] RefinementOutcome refinement_outcome(const Rig& rig,
                                                   const nlohmann::ordered_json& report);

}  // namespace pencilscan
