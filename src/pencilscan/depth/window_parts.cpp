#include "pencilscan/depth/window_parts.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace pencilscan {
namespace {

constexpr float kSideStart = 0.2F;  // of the radius: where a side of the window begins
constexpr float kMiddle2 = 0.2F;    // squared radius of the middle, in radii

constexpr int kStripsPerPx = 2;

/// LightSums of a pixel, or over several.
using PixelLight __attribute__((vector_size(16))) = float;
enum : int { kShown, kExpected, kSeen, kPredicted };

// Deviations of the noise that a part lacks of its light: one in 160 is as dark by noise alone.
constexpr float kPartBelow = 2.5F;
// Of the 200 edges of a window of 5 px (most of them share pixels) noise makes one in 150 windows.
constexpr float kEdgeBelow = 4;

/// Whether a part shows too little of the light that is predicted in it. `energy`: the predicted
/// light's squares over the variance of the noise; `seen`: the same of predicted and seen light, of
/// which noise makes the square root of the energy.
bool is_dark(float seen, float energy, float deviations) {
  constexpr float kLeastLight = 0.6F;  // share of the predicted light
  return seen < std::min(kLeastLight * energy, energy - deviations * std::sqrt(energy));
}

}  // namespace

WindowParts::WindowParts(const WindowGrid& grid) : grid_(&grid), masks_(kParts * grid.padded, 0.F) {
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
  list_strips();
  reset();
}

WindowParts::Edge WindowParts::edge_of(std::size_t direction, float offset) {
  const double angle = 2 * std::numbers::pi * static_cast<double>(direction) / kDirections;
  return {static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle)), offset};
}

void WindowParts::list_strips() {
  const float* x = grid_->monomial(1);
  const float* y = grid_->monomial(2);
  // How many strips out each pixel lies, from 1; 0: inwards of the middle.
  std::vector<int> strip_of(static_cast<std::size_t>(grid_->count));
  for (std::size_t direction = 0; direction < kDirections; ++direction) {
    const Edge edge = edge_of(direction, 0);
    for (std::size_t i = 0; i < strip_of.size(); ++i) {
      const float out = static_cast<float>(grid_->half) * (x[i] * edge.cosine + y[i] * edge.sine);
      strip_of[i] = std::max(0, static_cast<int>(std::floor(kStripsPerPx * out + 1)));
    }
    for (int strip = *std::max_element(strip_of.begin(), strip_of.end()); strip >= 1; --strip) {
      const std::size_t before = pixels_.size();
      for (std::size_t i = 0; i < strip_of.size(); ++i) {
        if (strip_of[i] == strip) pixels_.push_back(static_cast<std::uint16_t>(i));
      }
      if (pixels_.size() == before) continue;
      strips_[direction].push_back({static_cast<float>(strip - 1) / kStripsPerPx,
                                    static_cast<std::uint16_t>(pixels_.size())});
    }
  }
}

void WindowParts::reset() {
  for (std::vector<float>* sums :
       {&light_.shown, &light_.expected, &light_.seen, &light_.predicted})
    sums->assign(grid_->padded, 0.F);
}

void WindowParts::add(const FamilyLight& light, const float* image, const float* weight,
                      float certainty) {
  if (light.patterns > 0) add_light(*grid_, light, image, weight, certainty, light_);
}

void WindowParts::sum_up() {
  sum_parts(*grid_, light_.seen.data(), masks_.data(), kParts, seen_in_.data());
  sum_parts(*grid_, light_.predicted.data(), masks_.data(), kParts, predicted_in_.data());
}

// Of pixels with the light L predicted and S seen, both over the noise, twice the logarithm of the
// likelihood that they are lit, over that of the dark, is S^2 - (S - L)^2 = 2 S L - L^2.
std::optional<WindowParts::Edge> WindowParts::edge(float misfit) const {
  // Light that is not where it was predicted is no darkness: relief moves lines.
  constexpr float kMostShown = 0.5F;
  const float certainty = 1 / std::max(1.F, misfit);
  thread_local std::vector<PixelLight> light;
  light.resize(static_cast<std::size_t>(grid_->count));
  for (std::size_t i = 0; i < light.size(); ++i)
    light[i] = PixelLight{light_.shown[i], light_.expected[i], light_.seen[i], light_.predicted[i]};
  const std::uint16_t* pixel = pixels_.data();
  std::optional<Edge> best;
  float least = 0;
  for (std::size_t direction = 0; direction < kDirections; ++direction) {
    PixelLight beyond = {};
    for (const Strip& strip : strips_[direction]) {
      PixelLight sum = {};
      for (const std::uint16_t* end = pixels_.data() + strip.end; pixel != end; ++pixel)
        sum += light[*pixel];
      beyond += sum;
      const float lit = 2 * beyond[kSeen] - beyond[kPredicted];
      if (lit >= least || beyond[kShown] > kMostShown * beyond[kExpected] ||
          !is_dark(certainty * beyond[kSeen], certainty * beyond[kPredicted], kEdgeBelow))
        continue;
      least = lit;
      best = edge_of(direction, strip.offset);
    }
  }
  return best;
}

std::optional<std::size_t> WindowParts::dark_side() const {
  std::optional<std::size_t> darkest;
  float least = 1;
  for (std::size_t side = 0; side < kSides; ++side) {
    const float energy = predicted_in_[side];
    const float seen = seen_in_[side];
    if (!is_dark(seen, energy, kPartBelow) || seen > least * energy) continue;
    least = seen / energy;
    darkest = side;
  }
  return darkest;
}

bool WindowParts::is_middle_dark() const {
  return is_dark(seen_in_[kSides], predicted_in_[kSides], kPartBelow);
}

}  // namespace pencilscan
