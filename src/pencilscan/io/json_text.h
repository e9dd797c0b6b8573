#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace pencilscan {

/// Parsed JSON; InputError, with `name` as its file, as read_json().
[[nodiscard]] nlohmann::json parse_json(const std::string& text, const std::string& name);
/// What write_json() writes.
[[nodiscard]] std::string json_text(const nlohmann::ordered_json& value);

}  // namespace pencilscan
