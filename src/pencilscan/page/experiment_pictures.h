#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "pencilscan/page/experiment.h"
#include "pencilscan/page/flaw.h"

namespace pencilscan {

/// Adds json["pictures"] and their bytes to the page. Pictures directly in the folder come first;
/// of folders of pictures, as many as fit are taken, evenly picked (001_a.png and 001_b.png
/// together). note: is told what cannot be shown, and why.
void add_pictures(const ExperimentFolder& folder, const ExperimentDetail& detail,
                  const FlawNote& note, ExperimentPage& page);

/// What kind of picture a file is, by its ending and first bytes; nothing for other files.
[[nodiscard]] std::optional<ExperimentPicture::Kind> picture_kind(
    const std::filesystem::path& file);

}  // namespace pencilscan
