#include "pencilscan/depth/window_parts.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace pencilscan {
namespace {

constexpr float kSideStart = 0.2F;    // of the radius: where a side of the window begins
constexpr float kLeastLight = 0.6F;   // share of the predicted light that a part must show ...
constexpr float kLeastEnergy = 40.F;  // ... where that would be beyond noise
constexpr float kMiddle2 = 0.2F;      // squared radius of the middle, in radii

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
  float least = kLeastLight;
  for (std::size_t side = 0; side < kSides; ++side) {
    const float energy = predicted_in_[side];
    const float seen = seen_in_[side];
    if (!(energy > kLeastEnergy && seen < least * energy)) continue;
    least = seen / energy;
    darkest = side;
  }
  return darkest;
}

bool WindowParts::is_middle_dark() const {
  const float energy = predicted_in_[kSides];
  return energy > kLeastEnergy && seen_in_[kSides] < kLeastLight * energy;
}

}  // namespace pencilscan
