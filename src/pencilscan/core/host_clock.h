#pragma once

#include <chrono>
#include <cstdint>

namespace pencilscan {

/// Nanoseconds of the clock that never steps: what pictures on screens and of cameras are timed by.
[[nodiscard]] inline std::int64_t host_now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

/// What to add to host_now_ns() for nanoseconds since 1970 (UTC), as of now.
[[nodiscard]] inline std::int64_t utc_minus_host_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
             .count() -
         host_now_ns();
}

}  // namespace pencilscan
