#pragma once

#include <optional>
#include <span>
#include <vector>

#include "pencilscan/pattern/pattern_color.h"

namespace pencilscan {

/// What a measured colour of a line may be off by, as a share of the line's brightness: objects are
/// coloured, and channels show some of each other.
inline constexpr double kColorError = 0.12;

/// Colours of one direction, to kColorError: at any brightness a camera takes one for the other.
[[nodiscard]] bool look_alike(const PatternColor& a, const PatternColor& b);

/// True where `full` looks like `rest` on a surface that gives back none of some channels: cyan is
/// blue where there is no green.
[[nodiscard]] bool is_rest_of(const PatternColor& rest, const PatternColor& full);

/// Index of the colour whose direction is nearest; the same colour, where it is among them.
[[nodiscard]] int likeliest_color(const PatternColor& color, std::span<const PatternColor> family);

/// Which of `family` each of `colors` looks like; nothing unless each has one of its own, and all
/// of `family` have one.
[[nodiscard]] std::optional<std::vector<int>> paired_colors(std::span<const PatternColor> colors,
                                                            std::span<const PatternColor> family);

}  // namespace pencilscan
