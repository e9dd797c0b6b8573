#pragma once

#include <exception>
#include <filesystem>
#include <string>

namespace pencilscan {

/// Makes the process keep freed memory for its next images instead of returning it to the system,
/// which would clear every page again. For programs, at their start; glibc only, else nothing.
void keep_freed_memory();

/// Bytes that this process may still take before the system, its own limit (RLIMIT_AS) or that of a
/// control group (a container, a job of Slurm) has no more; infinity where none tells.
[[nodiscard]] double available_memory();

/// The same by control groups alone. `groups` is the text of /proc/self/cgroup, and `mount` the
/// folder of the groups (/sys/fs/cgroup). Each group counts with all above it, of version 2 and 1.
/// "max", sizes that no computer has and files that cannot be read are no limit.
[[nodiscard]] double memory_of_groups(const std::string& groups,
                                      const std::filesystem::path& mount);

/// True for an error that says, in its own or a library's way, that memory could not be had, or a
/// thread, which needs some.
[[nodiscard]] bool is_of_memory(const std::exception& error);

/// What the user is told of an error: its own text, or plain words for lack of memory.
[[nodiscard]] std::string in_plain_words(const std::exception& error);

}  // namespace pencilscan
