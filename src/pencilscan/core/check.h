#pragma once

namespace pencilscan {

/// Reports a broken invariant (a bug in this program, never bad input) and aborts.
[[noreturn]] void check_failed(const char* expression, const char* file, int line);

}  // namespace pencilscan

/// Aborts with expression and place when an invariant does not hold. On in every build type.
#define PENCILSCAN_CHECK(expression)                    \
  (static_cast<bool>(expression) ? static_cast<void>(0) \
                                 : ::pencilscan::check_failed(#expression, __FILE__, __LINE__))
