#pragma once

#include <string>

namespace pencilscan {

/// Adds one more name to the list of a sentence.
inline void add_name(std::string& names, const std::string& name, const char* separator = ", ") {
  names += (names.empty() ? "" : separator) + name;
}

}  // namespace pencilscan
