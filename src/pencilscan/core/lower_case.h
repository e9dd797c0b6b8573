#pragma once

#include <algorithm>
#include <cctype>
#include <string>

namespace pencilscan {

/// ASCII letters in lower case, as names of files are compared.
[[nodiscard]] inline std::string lower_case(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

}  // namespace pencilscan
