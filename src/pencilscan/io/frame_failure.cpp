#include "pencilscan/io/frame_failure.h"

#include <nlohmann/json.hpp>

#include "pencilscan/core/error.h"
#include "pencilscan/io/file.h"

namespace pencilscan {

std::optional<FrameFailureText> read_failure(const std::filesystem::path& folder) {
  const std::filesystem::path file = folder / "failure.json";
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored)) return std::nullopt;
  const FrameFailureText unknown{"it failed, and its failure.json does not say why", false};
  try {
    const nlohmann::json json = read_json(file);
    const bool says_why = json.is_object() && json.contains("reason") && json["reason"].is_string();
    if (!says_why) return unknown;
    return FrameFailureText{json["reason"].get<std::string>(),
                            json.value("is_passing", nlohmann::json()) == true};
  } catch (const InputError&) {
    return unknown;
  }
}

}  // namespace pencilscan
