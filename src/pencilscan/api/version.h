#pragma once

namespace pencilscan {

/// "major.minor.patch" of the library that is linked.
[[nodiscard]] const char* version();

}  // namespace pencilscan
