#pragma once

#include <functional>
#include <string_view>

namespace pencilscan {

/// Called by long stages with what they do and how far they are (0..1). May be called from any
/// thread, one call at a time; empty means nobody listens.
using Progress = std::function<void(std::string_view what, double fraction)>;

}  // namespace pencilscan
