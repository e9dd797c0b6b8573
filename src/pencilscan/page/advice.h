#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace pencilscan {

/// A warning in plain words and what to do about it.
struct Advice {
  std::string warning;
  std::string action;  ///< may be empty
};

/// Why a frame has no result, by its failure.json in its folder, and what to do about it.
[[nodiscard]] Advice advise_failure(const std::filesystem::path& folder);

/// The warnings of a frame's report.json, with advice, and what its counts say beyond them: much
/// undecided, surface in shadow, lines too dense, open surface. Tolerates any JSON.
[[nodiscard]] std::vector<Advice> advise(const nlohmann::json& report);

}  // namespace pencilscan
