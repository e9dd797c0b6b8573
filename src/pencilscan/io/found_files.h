#pragma once

#include <filesystem>
#include <string>
#include <system_error>

namespace pencilscan {

/// What a folder holds, for messages that say what was expected instead: "it holds IMG_000.png,
/// IMG_001.png, IMG_002.png and 39 more", "it holds only folders: a, b", "it is empty", "it cannot
/// be listed: Permission denied". Files before folders, nothing of what begins with a dot.
[[nodiscard]] std::string holdings(const std::filesystem::path& folder);

/// True where a file or folder is not there. Any other error hides what may be there.
[[nodiscard]] bool is_absence(const std::error_code& error);

}  // namespace pencilscan
