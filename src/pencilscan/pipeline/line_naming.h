#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "pencilscan/pipeline/frame.h"

namespace pencilscan {

/// Joint labels of one frame.
struct LineNaming {
  Labeling labeling;
  std::optional<Rig> corrected;  ///< that the labels were made with, where it is not the one given
  CrossingDisagreement crossings;                      ///< of the labels, with the rig as given
  std::vector<CrossingDisagreement> device_crossings;  ///< the same; empty without crossings
  std::optional<Warning> warning;
};

/// Of a method that may correct the rig (MethodCapabilities). Keeps the names that the solution
/// gave with the rig as given. Where their crossings then miss each other, or many curves stay
/// without a name, with the rig as the crossings correct it (refine_rig_on_frames), if its own
/// crossings agree, or agree better, or clearly more curves have a name. Where crossings meet as
/// closely as noise lets expect, and most curves of every camera have a name once the surface of
/// the others has guided them (`guided_share`: of the points of the camera that has fewest, asked
/// only then; nobody to ask: none has), the rig is not doubted: curves that are close together wait
/// for their surface.
[[nodiscard]] LineNaming name_lines(const Rig& rig, const std::vector<ColorFamily>& families,
                                    const std::vector<GridGraph>& graphs, Labeling labeling,
                                    const PointOptions& options,
                                    const std::function<double()>& guided_share = {});

}  // namespace pencilscan
