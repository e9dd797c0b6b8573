#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

namespace pencilscan {

/// The table of sequence.json (docs/formats.md) by columns, which take a fifth of its room:
/// `frames` (names), `states`, `columns` (per figure one number a frame, null where it is not
/// known), `remarks` ([frame index, text]), `events`, `holes`, `cameras` and `projectors` as they
/// are there. What is not as the format says is left out.
[[nodiscard]] nlohmann::ordered_json sequence_columns(const nlohmann::ordered_json& sequence);

/// Compressed sequence_columns() of an output folder; of a file that cannot be read, `broken` says
/// why. Empty: the folder has no sequence.json.
[[nodiscard]] std::string sequence_part(const std::filesystem::path& root);

}  // namespace pencilscan
