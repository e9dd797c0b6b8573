#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

namespace pencilscan {

/// Adds one more name to the list of a sentence.
inline void add_name(std::string& names, const std::string& name, const char* separator = ", ") {
  names += (names.empty() ? "" : separator) + name;
}

/// Of frames and rows, so many are named.
inline constexpr std::size_t kNamedFrames = 8;

/// "cam0, cam1", or "000012, 000020 and 5 more" of more than `most`.
[[nodiscard]] inline std::string name_list(
    const std::vector<std::string>& names,
    std::size_t most = std::numeric_limits<std::size_t>::max()) {
  std::string text;
  for (std::size_t i = 0; i < std::min(names.size(), most); ++i) add_name(text, names[i]);
  if (names.size() > most) text += " and " + std::to_string(names.size() - most) + " more";
  return text;
}

/// "3 (000012, 000020, 000021)": how many frames or rows, and the first of them.
[[nodiscard]] inline std::string counted_names(const std::vector<std::string>& names) {
  return std::to_string(names.size()) + " (" + name_list(names, kNamedFrames) + ")";
}

}  // namespace pencilscan
