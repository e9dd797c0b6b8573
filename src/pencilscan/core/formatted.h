#pragma once

#include <array>
#include <cstdio>
#include <string>

namespace pencilscan {

/// A number in a sentence, as printf has it with this format; at most 47 characters.
[[nodiscard]] inline std::string formatted(double value, const char* format = "%.2g") {
  std::array<char, 48> text{};
  std::snprintf(text.data(), text.size(), format, value);
  return text.data();
}

}  // namespace pencilscan
