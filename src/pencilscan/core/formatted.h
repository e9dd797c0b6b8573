#pragma once

#include <array>
#include <cmath>
#include <cstdio>
#include <string>

namespace pencilscan {

/// A number in a sentence, as printf has it with this format; at most 47 characters.
[[nodiscard]] inline std::string formatted(double value, const char* format = "%.2g") {
  std::array<char, 48> text{};
  std::snprintf(text.data(), text.size(), format, value);
  return text.data();
}

/// A number with so many digits behind the point.
[[nodiscard]] inline std::string fixed(double value, int decimals) {
  std::array<char, 48> text{};
  std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  return text.data();
}

/// The size of a picture or panel in a sentence: "1920 x 1080".
[[nodiscard]] inline std::string size_text(int width, int height) {
  return std::to_string(width) + " x " + std::to_string(height);
}

/// A share as "0.42 %", "4.2 %" or "38 %": two digits below 10, whole numbers from there on.
[[nodiscard]] inline std::string percent_text(double share) {
  return formatted(100 * share, std::abs(100 * share) < 9.95 ? "%.2g %%" : "%.0f %%");
}

}  // namespace pencilscan
