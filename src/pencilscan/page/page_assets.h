#pragma once

#include <string_view>

namespace pencilscan {

/// The page that web/build.mjs made, in three pieces: data goes between the first two (the blocks
/// of a report) and the last two (the index).
struct PageAssets {
  std::string_view head;
  std::string_view middle;
  std::string_view tail;
};
[[nodiscard]] PageAssets page_assets();

}  // namespace pencilscan
