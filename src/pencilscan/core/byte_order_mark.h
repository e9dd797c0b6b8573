#pragma once

#include <string>
#include <string_view>

namespace pencilscan {

/// A text without the bytes that editors of Windows put before UTF-8.
[[nodiscard]] inline std::string without_byte_order_mark(std::string text) {
  constexpr std::string_view kMark = "\xEF\xBB\xBF";
  if (text.starts_with(kMark)) text.erase(0, kMark.size());
  return text;
}

}  // namespace pencilscan
