#include "pencilscan/pattern/color_likeness.h"

#include <algorithm>
#include <cmath>

namespace pencilscan {
namespace {

/// Cosine between the lights of two colours.
double likeness(const PatternColor& a, const PatternColor& b) {
  double product = 0;
  double a2 = 0;
  double b2 = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    product += a.light()[c] * b.light()[c];
    a2 += a.light()[c] * a.light()[c];
    b2 += b.light()[c] * b.light()[c];
  }
  return product / std::sqrt(a2 * b2);
}

}  // namespace

bool look_alike(const PatternColor& a, const PatternColor& b) {
  // The part of one across the other is the sine of their angle.
  const double cosine = likeness(a, b);
  return cosine > 0 && 1 - cosine * cosine < kColorError * kColorError;
}

bool is_rest_of(const PatternColor& rest, const PatternColor& full) {
  const auto has = [](const PatternColor& color, std::size_t channel) {
    const Rgb& light = color.light();
    return light[channel] > kColorError * std::hypot(light[0], light[1], light[2]);
  };
  Rgb left{};
  bool lacks = false;
  for (std::size_t c = 0; c < 3; ++c) {
    if (has(rest, c)) left[c] = full.light()[c];
    lacks = lacks || (has(full, c) && !has(rest, c));
  }
  return lacks && std::hypot(left[0], left[1], left[2]) > 0 && look_alike(PatternColor(left), rest);
}

int likeliest_color(const PatternColor& color, std::span<const PatternColor> family) {
  auto found = std::find(family.begin(), family.end(), color);
  if (found == family.end())
    found = std::max_element(family.begin(), family.end(), [&](const auto& a, const auto& b) {
      return likeness(color, a) < likeness(color, b);
    });
  return static_cast<int>(found - family.begin());
}

std::optional<std::vector<int>> paired_colors(std::span<const PatternColor> colors,
                                              std::span<const PatternColor> family) {
  if (colors.size() != family.size()) return std::nullopt;
  std::vector<int> partners;
  std::vector<char> taken(family.size(), 0);
  for (const PatternColor& color : colors) {
    const auto at = static_cast<std::size_t>(likeliest_color(color, family));
    if (!look_alike(color, family[at]) || taken[at] != 0) return std::nullopt;
    taken[at] = 1;
    partners.push_back(static_cast<int>(at));
  }
  return partners;
}

}  // namespace pencilscan
