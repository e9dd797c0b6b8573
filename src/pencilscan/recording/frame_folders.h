#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace pencilscan {

/// The frame folders below `folder` in their order: by number where all names are digits, else by
/// name; not those whose names begin with a dot. InputError when there is none.
[[nodiscard]] std::vector<std::string> frame_folder_names(const std::filesystem::path& folder);

/// Says where the order of names is not that of the numbers in them: shot_10 before shot_2.
/// `names`: in order.
[[nodiscard]] std::optional<std::string> order_warning(std::span<const std::string> names);

/// The name of frame k: six digits.
[[nodiscard]] std::string six_digits(std::size_t frame);

/// Pictures of one camera by their row.
using CameraFiles = std::map<std::size_t, std::filesystem::path>;

/// The pictures below a folder of frame folders.
struct FoundFrames {
  std::vector<std::string> names;              ///< by row; empty: no folder, or one of no picture
  std::vector<std::string> without_picture;    ///< names of folders
  std::map<std::string, CameraFiles> cameras;  ///< by name
};
/// Rows are the numbers of folders of six digits, else their places in the order of names.
/// InputError where there is no picture at all.
[[nodiscard]] FoundFrames find_pictures(const std::filesystem::path& folder);

}  // namespace pencilscan
