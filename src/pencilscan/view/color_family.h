#pragma once

#include <string>
#include <vector>

#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// All patterns drawn with one set of colours, or with colours that a camera takes for these
/// (color_likeness.h): `colors` are those of its first pattern. One family = one ridge image:
/// `presence` weighs unmixed projector red, green, blue so that each of its colours gives 1 and
/// those of the other families give 0 (blue/cyan against red/yellow: the blue channel).
struct ColorFamily {
  std::vector<PatternColor> colors;
  std::vector<PatternRef> patterns;
  Vec3 presence = Vec3::Zero();
  double leakage = 0;  ///< largest |presence . colour of another family|; 0: separable

  /// The other families' light is in its picture, and none of the lines there explain it: more of
  /// it than colours are known to.
  [[nodiscard]] bool mixes() const { return leakage > 0.1; }
  /// Index in `colors` of each symbol of a pattern's alphabet.
  [[nodiscard]] std::vector<int> color_of_symbol(const LinePattern& pattern) const;
};

/// In the order in which the rig's patterns first have their colours.
[[nodiscard]] std::vector<ColorFamily> color_families(const Rig& rig);
/// Index of the family that has a pattern; -1: none.
[[nodiscard]] int family_of(const std::vector<ColorFamily>& families, PatternRef pattern);

/// The rig with every pattern where the projector's model has the colours by which its lines are
/// found (presence), so that color_registration of projectors is spent: twice is as once. Lines of
/// one pattern that different colours show get the mean over the pattern's colours.
[[nodiscard]] Rig with_registered_patterns(Rig rig);

}  // namespace pencilscan
