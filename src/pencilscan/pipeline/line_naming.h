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

/// Points of a camera's curves that can have a name: all but those whose rays meet no line in the
/// volume (walls, a floor, people).
[[nodiscard]] std::size_t nameable_points(const GridGraph& graph, const Labeling& labeling);

/// The share of a camera's nameable points that have a name, of the camera where it is least: one
/// that stands elsewhere has few. A camera without any does not count.
[[nodiscard]] double named_share(const std::vector<GridGraph>& graphs, const Labeling& labeling);

/// Decides whether lines keep the names that the solution gave with the rig as given, or get names
/// with a corrected rig. For methods that may correct the rig (MethodCapabilities).
///
/// The rig is doubted where crossings miss each other, or where many curves in the volume have no
/// name. It is not doubted where crossings meet about as closely as noise lets expect and most
/// curves of every camera have a name after guided matching: curves that are close together only
/// need the surface.
/// (`guided_share` gives the named_share() after guided matching. It is asked only where it may be
/// less than enough: guided matching takes no name away. Without it, the share counts as 0.)
///
/// A rig in doubt is corrected from the crossings (refine_rig_on_frames). The names with the
/// corrected rig are taken if its crossings agree, or agree better, or if clearly more curves have
/// a name.
[[nodiscard]] LineNaming name_lines(const Rig& rig, const std::vector<ColorFamily>& families,
                                    const std::vector<GridGraph>& graphs, Labeling labeling,
                                    const PointOptions& options,
                                    const std::function<double()>& guided_share = {});

}  // namespace pencilscan
