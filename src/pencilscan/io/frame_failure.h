#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace pencilscan {

/// What a frame's failure.json says (docs/formats.md).
struct FrameFailureText {
  std::string reason;
  bool is_passing = false;  ///< the same inputs may do better another time
};

/// Why a frame's folder holds no result. Nothing where it has no failure.json; a broken one is a
/// reason too.
[[nodiscard]] std::optional<FrameFailureText> read_failure(const std::filesystem::path& folder);

}  // namespace pencilscan
