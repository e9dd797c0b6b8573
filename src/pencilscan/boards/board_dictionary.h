#pragma once

#include <optional>
#include <string>

namespace pencilscan {

/// OpenCV's number of a predefined dictionary of markers, by its name.
[[nodiscard]] std::optional<int> dictionary_id(const std::string& name);

}  // namespace pencilscan
