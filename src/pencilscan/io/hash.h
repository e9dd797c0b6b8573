#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace pencilscan {

/// FNV-1a hash, to tell whether an input is the same; no defence against anybody.
[[nodiscard]] std::uint64_t hash_bytes(std::string_view bytes,
                                       std::uint64_t hash = 14695981039346656037ULL);
/// Sixteen hexadecimal digits.
[[nodiscard]] std::string hex(std::uint64_t value);

}  // namespace pencilscan
