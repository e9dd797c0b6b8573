#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "pencilscan/rig/rig.h"

namespace pencilscan::cli {

/// Index of a device in the list of all (device_list.h); InputError of `option` without it.
[[nodiscard]] std::size_t device_by_name(const Rig& rig, const std::string& name,
                                         const std::string& option);

/// A finite number > 0 that is all of the text.
[[nodiscard]] std::optional<double> positive_number(const std::string& text);

}  // namespace pencilscan::cli
