#pragma once

namespace pencilscan {

/// Nearest integer of a coordinate above -4096, without the library call that std::lround() is on
/// plain x86-64.
[[nodiscard]] inline int nearest(float x) { return static_cast<int>(x + 4096.5F) - 4096; }

}  // namespace pencilscan
