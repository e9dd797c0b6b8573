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
  RigInFrame rig_in_frame = RigInFrame::kAsGiven;
  std::optional<Warning> warning;
  std::optional<Warning> color_warning;  ///< the colours of lines do not tell them apart
};

/// The curve points of a picture that tell whether picture and rig are right: where both are, most
/// of them have a name. Points of curves that nothing crosses are not among them, nor points
/// outside the volume (walls, a floor, people): these say nothing.
struct TellingPoints {
  std::size_t named = 0;
  std::size_t unnamed = 0;

  void add(const TellingPoints& other) {
    named += other.named;
    unnamed += other.unnamed;
  }
  [[nodiscard]] std::size_t all() const { return named + unnamed; }
  [[nodiscard]] bool are_enough() const { return all() >= 500; }  ///< to judge a picture
  [[nodiscard]] double named_share() const {
    return named > 0 ? static_cast<double>(named) / static_cast<double>(all()) : 0;
  }
};
[[nodiscard]] TellingPoints telling_points(const Labeling& labeling, std::size_t camera);

/// The share of a camera's telling points that have a name, of the camera where it is least: one
/// that stands elsewhere has few. A camera without enough of them does not count.
[[nodiscard]] double least_named_share(const Labeling& labeling);
inline constexpr double kMostNamed = 0.5;  ///< of it: the rest are close together, or no lines

/// Decides whether lines keep the names that the solution gave with the rig as given, or get names
/// with a corrected rig. For methods that may correct the rig (MethodCapabilities).
///
/// Without enough crossings the rig stays as given. It is wrong where one of these signs says so:
///   1. crossings miss each other,
///   2. curves have the colours of other lines (naming_doubt.h).
/// Otherwise it is in doubt where a fifth of the telling points or more have no name, unless two of
/// these three signs say that it is right:
///   1. crossings meet about as closely as noise lets expect,
///   2. most telling points of every camera have a name,
///   3. `is_confirmed()` is true. It is asked only where it decides.
///
/// A rig that is wrong or in doubt is corrected from the crossings (refine_rig_on_frames()). The
/// names with the corrected rig are taken
///   1. of a wrong rig, if the crossings agree, or miss less and more points have a name, or miss
///      about as much and clearly more points have a name,
///   2. of a rig in doubt, if the crossings agree and clearly more points have a name.
[[nodiscard]] LineNaming name_lines(const Rig& rig, const std::vector<ColorFamily>& families,
                                    const std::vector<GridGraph>& graphs, Labeling labeling,
                                    const PointOptions& options,
                                    const std::function<bool()>& is_confirmed = {});

}  // namespace pencilscan
