#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "pencilscan/depth/window_sums.h"

namespace pencilscan {

/// Whether parts of a window show the light that a fit predicts there: eight overlapping sides,
/// beyond a fifth of the radius in as many directions, and the middle. A part shows too little
/// where it has less than .6 of that light, and 2.5 deviations of the noise less than all of it:
/// few samples tell what is quite dark. And where the surface ends in a straight edge: the one
/// beyond which darkness explains the image best, of 16 directions and half pixels.
class WindowParts {
 public:
  /// The grid must outlive it.
  explicit WindowParts(const WindowGrid& grid);

  /// Begins anew: reset(), then add() for each family, as add_light() takes it, then sum_up().
  void reset();
  void add(const FamilyLight& light, const float* image, const float* weight, float certainty);
  void sum_up();

  /// Where the surface ends: `offset` px from the middle, outwards along (cosine, sine).
  struct Edge {
    float cosine = 0, sine = 0;
    float offset = 0;
  };
  /// The edge beyond which the image most likely is dark, where the middle lies within it.
  /// `misfit`: of the fit, chi^2 per degree of freedom; it counts as noise.
  [[nodiscard]] std::optional<Edge> edge(float misfit) const;

  /// The side that shows too little of the predicted light, the darkest.
  [[nodiscard]] std::optional<std::size_t> dark_side() const;
  [[nodiscard]] bool is_middle_dark() const;
  /// Per pixel of the grid, 1 in a side.
  [[nodiscard]] const float* side(std::size_t side) const {
    return masks_.data() + side * grid_->padded;
  }

 private:
  static constexpr std::size_t kSides = 8;
  static constexpr std::size_t kParts = kSides + 1;
  static constexpr std::size_t kDirections = 16;  ///< of edges

  static Edge edge_of(std::size_t direction, float offset);
  void list_strips();

  const WindowGrid* grid_;
  std::vector<float> masks_;  ///< of the sides, then of the middle
  /// Pixels of a strip half a pixel wide across a direction, outwards of the middle.
  struct Strip {
    float offset = 0;       ///< where it begins
    std::uint16_t end = 0;  ///< of its pixels among those of all strips
  };
  std::vector<std::uint16_t> pixels_;  ///< of all strips, one after another
  /// Per direction those that have pixels, the outermost first.
  std::array<std::vector<Strip>, kDirections> strips_;
  LightSums light_;
  std::array<float, kParts> seen_in_{}, predicted_in_{};
};

}  // namespace pencilscan
