#pragma once

#include <vector>

#include "pencilscan/depth/window_equations.h"
#include "pencilscan/depth/window_sums.h"

namespace pencilscan {

/// Of the prior on the slope of albedo over a window (e_x, e_y of FamilyLight): a deviation of 0.3,
/// as 1 / variance.
constexpr double kTiltPrecision = 11;

/// Makes the normal equations of one family after the other over a window; keeps its memory.
class FamilyEquations {
 public:
  /// patterns: the most that a family has.
  FamilyEquations(const WindowGrid& grid, std::size_t patterns);

  /// Products of the family's columns with each other (make_columns()), as solve() and add() leave
  /// them: patterns, offset, e_x, e_y, residual.
  [[nodiscard]] double product(int i, int j) const {
    return static_cast<double>(gram_[static_cast<std::size_t>(i * all_ + j)]);
  }
  /// Sums them for the light as it is; `image`, `root` (of the weights): of the grid's pixels.
  /// `unit`: as make_columns().
  void sum(const FamilyLight& light, const float* image, const float* root, float unit);
  /// Sums those of patterns, offset and image alone (make_light_columns()).
  void sum_light(const FamilyLight& light, const float* image, const float* root);
  /// Adds what they say, times `certainty`, to the equations of a family, whose unknowns are then
  /// the patterns' amplitudes, the offset, e_x and e_y, and to those of the surface. After sum().
  void add(const FamilyLight& light, double certainty, std::size_t family,
           WindowEquations& equations);

 private:
  const WindowGrid* grid_;
  FamilyColumns columns_;
  SurfaceSums surface_;
  std::vector<float> gram_;
  int all_ = 0;  ///< columns of the products
};

}  // namespace pencilscan
