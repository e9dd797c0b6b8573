#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace pencilscan {

/// Parsed JSON; InputError, with `name` as its file, as read_json().
[[nodiscard]] nlohmann::json parse_json(const std::string& text, const std::string& name);
/// What write_json() writes. What is not UTF-8, as the name of a folder in Latin-1, becomes U+FFFD.
[[nodiscard]] std::string json_text(const nlohmann::ordered_json& value);
/// The same on one line, for what a server answers.
[[nodiscard]] std::string json_line(const nlohmann::ordered_json& value);
/// True where JSON can hold the text as it is.
[[nodiscard]] bool is_utf8(const std::string& text);

}  // namespace pencilscan
