#pragma once

namespace pencilscan {

/// Makes the process keep freed memory for its next images instead of returning it to the system,
/// which would clear every page again. For programs, at their start; glibc only, else nothing.
void keep_freed_memory();

/// Bytes that this process may still take before the system or its own limit (RLIMIT_AS) has no
/// more; infinity where neither tells.
[[nodiscard]] double available_memory();

}  // namespace pencilscan
