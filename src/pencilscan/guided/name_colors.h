#pragma once

#include <optional>
#include <span>
#include <vector>

#include "pencilscan/detection/curve.h"
#include "pencilscan/guided/predicted_lines.h"
#include "pencilscan/rig/rig.h"
#include "pencilscan/view/color_family.h"

namespace pencilscan {

/// Points [begin, end) of a curve.
struct PointRange {
  int begin;
  int end;
};

/// Where along a curve one line is predicted.
struct NamedPieces {
  LineName name;
  std::vector<PointRange> pieces;
};
/// `names`: per point of a curve; nothing where no line is predicted.
[[nodiscard]] std::vector<NamedPieces> pieces_of_names(
    const std::vector<std::optional<LineName>>& names);
/// Of all pieces together.
[[nodiscard]] int points_of(std::span<const PointRange> pieces);

/// What the colours of curves say of line names.
class NameColors {
 public:
  NameColors(const Rig& rig, const std::vector<ColorFamily>& families)
      : rig_(rig), families_(families) {}

  /// Logarithm of how much likelier the colour of pieces of a curve is under a name than under
  /// the likeliest other colour; 0 where the family has one colour.
  [[nodiscard]] float margin(const Curve& curve, const std::vector<PointRange>& pieces,
                             const LineName& name) const;
  /// Logarithm of how much likelier it is under one name than under another.
  [[nodiscard]] float lead(const Curve& curve, const PointRange& piece, const LineName& name,
                           const LineName& other) const;

 private:
  [[nodiscard]] std::vector<float> evidence(const Curve& curve, const PointRange& piece) const;
  [[nodiscard]] std::size_t color_of(const LineName& name, int family) const;

  const Rig& rig_;
  const std::vector<ColorFamily>& families_;
};

}  // namespace pencilscan
