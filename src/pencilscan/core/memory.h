#pragma once

#include <exception>
#include <string>

namespace pencilscan {

/// Makes the process keep freed memory for its next images instead of returning it to the system,
/// which would clear every page again. For programs, at their start; glibc only, else nothing.
void keep_freed_memory();

/// Bytes that this process may still take before the system or its own limit (RLIMIT_AS) has no
/// more; infinity where neither tells.
[[nodiscard]] double available_memory();

/// True for an error that says, in its own or a library's way, that memory could not be had, or a
/// thread, which needs some.
[[nodiscard]] bool is_of_memory(const std::exception& error);

/// What the user is told of an error: its own text, or plain words for lack of memory.
[[nodiscard]] std::string in_plain_words(const std::exception& error);

}  // namespace pencilscan
