#pragma once

#include <array>
#include <cmath>

namespace pencilscan {

/// Two units that people confuse: what multiplies a length that was given in the first instead of
/// the second.
struct UnitFactor {
  double factor;
  const char* words;
};

inline constexpr std::array kUnitFactors = std::to_array<UnitFactor>({
    {1000, "metres instead of millimetres"},
    {304.8, "feet instead of millimetres"},
    {39.37, "metres instead of inches"},
    {25.4, "inches instead of millimetres"},
    {10, "centimetres instead of millimetres"},
    {0.001, "millimetres instead of metres"},
    {1 / 304.8, "millimetres instead of feet"},
    {1 / 39.37, "inches instead of metres"},
    {1 / 25.4, "millimetres instead of inches"},
    {0.1, "millimetres instead of centimetres"},
});

/// Units in which people give what should be in millimetres.
inline constexpr std::array kInsteadOfMillimetres = std::to_array<UnitFactor>({
    {1000, "metres instead of millimetres"},
    {304.8, "feet instead of millimetres"},
    {25.4, "inches instead of millimetres"},
    {10, "centimetres instead of millimetres"},
    {0.001, "micrometres instead of millimetres"},
});

/// The unit in which a length was given that is by this factor longer in millimetres, to within
/// `tolerance` (a share, below 0.4: units do not overlap then); null: none is.
[[nodiscard]] inline const UnitFactor* unit_behind_factor(double factor, double tolerance) {
  for (const UnitFactor& unit : kInsteadOfMillimetres)
    if (std::abs(factor / unit.factor - 1) <= tolerance) return &unit;
  return nullptr;
}

}  // namespace pencilscan
