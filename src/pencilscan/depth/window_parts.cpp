#include "pencilscan/depth/window_parts.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace pencilscan {
namespace {

constexpr float kSideStart = 0.2F;  // of the radius: where a side of the window begins
constexpr float kMiddle2 = 0.2F;    // squared radius of the middle, in radii

/// Whether a part shows too little of the light that is predicted in it. `energy`: the predicted
/// light's squares over the variance of the noise; `seen`: the same of predicted and seen light, of
/// which noise makes the square root of the energy.
bool is_dark(float seen, float energy) {
  constexpr float kLeastLight = 0.6F;   // share of the predicted light ...
  constexpr float kBeyondNoise = 2.5F;  // ... and deviations of the noise below it
  return seen < std::min(kLeastLight * energy, energy - kBeyondNoise * std::sqrt(energy));
}

}  // namespace

WindowParts::WindowParts(const WindowGrid& grid)
    : grid_(&grid),
      masks_(kParts * grid.padded, 0.F),
      seen_(grid.padded, 0.F),
      predicted_(grid.padded, 0.F) {
  const float* x = grid.monomial(1);
  const float* y = grid.monomial(2);
  for (std::size_t part = 0; part < kParts; ++part) {
    const double angle = 2 * std::numbers::pi * static_cast<double>(part) / kSides;
    const auto cosine = static_cast<float>(std::cos(angle));
    const auto sine = static_cast<float>(std::sin(angle));
    for (std::size_t i = 0; i < static_cast<std::size_t>(grid.count); ++i) {
      const bool is_in = part == kSides ? x[i] * x[i] + y[i] * y[i] < kMiddle2
                                        : x[i] * cosine + y[i] * sine > kSideStart;
      masks_[part * grid.padded + i] = is_in ? 1.F : 0.F;
    }
  }
}

void WindowParts::reset() {
  std::fill(seen_.begin(), seen_.end(), 0.F);
  std::fill(predicted_.begin(), predicted_.end(), 0.F);
}

void WindowParts::add(const FamilyLight& light, const float* image, const float* weight,
                      float certainty) {
  add_light(*grid_, light, image, weight, certainty, seen_.data(), predicted_.data());
}

void WindowParts::sum_up() {
  sum_parts(*grid_, seen_.data(), masks_.data(), kParts, seen_in_.data());
  sum_parts(*grid_, predicted_.data(), masks_.data(), kParts, predicted_in_.data());
}

std::optional<std::size_t> WindowParts::dark_side() const {
  std::optional<std::size_t> darkest;
  float least = 1;
  for (std::size_t side = 0; side < kSides; ++side) {
    const float energy = predicted_in_[side];
    const float seen = seen_in_[side];
    if (!is_dark(seen, energy) || seen > least * energy) continue;
    least = seen / energy;
    darkest = side;
  }
  return darkest;
}

bool WindowParts::is_middle_dark() const {
  return is_dark(seen_in_[kSides], predicted_in_[kSides]);
}

}  // namespace pencilscan
