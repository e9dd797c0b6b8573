#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/pipeline/pose_search.h"
#include "pencilscan/pipeline/rig_refinement.h"

namespace pencilscan {

// A projector that was knocked shows its lines farther from where the rig has them than they are
// apart: they have no names, or those of others. Where they are in space is measured all the same
// (projector_places.h): where lines of the other projectors cross them, and where two cameras see
// one of them. It stands where its lines go through these places in their colours.
//
// Its code begins anew after a period. So names a period off show the same colours, and the planes
// of the two sets of names differ by little: in how far they open, and in how lines at the sides
// lean. Poses at all turns that show about as many places are therefore settled, and compared by
// how closely their lines pass.

/// A projector, and where it stands.
struct FoundProjector {
  std::size_t projector = 0;
  PoseCorrection correction;
  double share = 0;       ///< of the places, those that show a line of their colour
  double lines_away = 0;  ///< median way of its lines from where the rig has them, in lines
  double gain = 0;        ///< of cost, from about where the rig has it, in squared deviations
  /// Names of other lines, with another turn, explain the places about as well.
  bool is_ambiguous = false;

  /// It stands elsewhere than the rig has it, beyond doubt: its lines are not beside the places.
  [[nodiscard]] bool is_elsewhere() const { return lines_away > kBesideLine && gain > kClearGain; }

  static constexpr double kOtherLine = 0.5;  ///< lines: from here on another one is nearer
  /// Of two poses the one is right then: by their likelihood once in 20,000 times the other one is.
  static constexpr double kClearGain = 20;
};

/// Of all projectors with enough places: where they stand, by the names of `labelings`, one per
/// frame; empty: by labels that are made without each. `rig`: in footprints, with registered
/// patterns.
[[nodiscard]] std::vector<FoundProjector> find_projectors(const Rig& rig,
                                                          std::span<const FrameCurves> frames,
                                                          std::span<const Labeling> labelings = {},
                                                          const PoseSearchOptions& options = {});

/// A projector that stands elsewhere than a rig has it in which crossings meet; or one of those
/// that were put back (`put_back`) and whose lines may as well have other names, since names of
/// other lines are then as likely. Nothing: none. `labelings`: of that rig.
[[nodiscard]] std::optional<FoundProjector> misplaced_projector(
    const Rig& rig, std::span<const FrameCurves> frames, std::span<const Labeling> labelings,
    std::span<const std::size_t> put_back = {});
/// In plain words.
[[nodiscard]] std::string misplaced_text(const Rig& rig, const FoundProjector& projector);

}  // namespace pencilscan
