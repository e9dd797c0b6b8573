#pragma once

#include <filesystem>
#include <string>

namespace pencilscan {

/// What a folder holds, for messages that say what was expected instead: "it holds IMG_000.png,
/// IMG_001.png, IMG_002.png and 39 more", "it holds only folders: a, b", "it is empty". Files
/// before folders, nothing of what begins with a dot.
[[nodiscard]] std::string holdings(const std::filesystem::path& folder);

}  // namespace pencilscan
