#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <ostream>
#include <string>

namespace pencilscan {

/// Appends a number to `bytes` in little-endian order.
template <class T>
void append_little_endian(std::string& bytes, T value) {
  auto raw = std::bit_cast<std::array<char, sizeof(T)>>(value);
  if constexpr (std::endian::native == std::endian::big) std::reverse(raw.begin(), raw.end());
  bytes.append(raw.data(), raw.size());
}

}  // namespace pencilscan
