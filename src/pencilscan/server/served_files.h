#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace pencilscan {

/// The regular file that `request` (a relative path with forward slashes, already percent-decoded)
/// names inside `root`, with all links followed; nothing when it is none, or lies outside of root:
/// by "..", an absolute path or a link.
[[nodiscard]] std::optional<std::filesystem::path> file_inside(const std::filesystem::path& root,
                                                               const std::string& request);

struct ServedFile {
  std::string path;  ///< relative to the root
  std::uintmax_t bytes = 0;
};
/// The files in a folder below the root, ordered, without those reached through links.
[[nodiscard]] std::vector<ServedFile> files_below(const std::filesystem::path& root,
                                                  const std::filesystem::path& folder);

/// By the ending; application/octet-stream for what a browser should not show.
[[nodiscard]] std::string content_type(const std::filesystem::path& file);

}  // namespace pencilscan
