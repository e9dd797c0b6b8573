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

/// The curve points of a picture that a right one, with a right rig, could have named: what nothing
/// crosses, or lies outside the volume (walls, a floor, people), says nothing.
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
/// The rig is doubted where crossings miss each other, or where many curves that others cross have
/// no name, of one device alone too, or have the colours of other lines (naming_doubt.h). It is not
/// doubted where two of three signs say that it is right: crossings meet about as closely as noise
/// lets expect; most such curves of every camera have a name; something else confirms it:
/// `is_confirmed`, asked only where it matters.
///
/// A rig in doubt is corrected from the crossings (refine_rig_on_frames). The names with the
/// corrected rig are taken if its crossings agree, or agree better, or if clearly more curves have
/// a name.
[[nodiscard]] LineNaming name_lines(const Rig& rig, const std::vector<ColorFamily>& families,
                                    const std::vector<GridGraph>& graphs, Labeling labeling,
                                    const PointOptions& options,
                                    const std::function<bool()>& is_confirmed = {});

}  // namespace pencilscan
