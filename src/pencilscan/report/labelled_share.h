#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>

namespace pencilscan {

/// The share of all detected curve points that got their line, by the cameras of a frame's
/// report.json. Nothing when there are no curve points, or the report does not say.
[[nodiscard]] std::optional<double> labelled_share(const nlohmann::json& report);

}  // namespace pencilscan
