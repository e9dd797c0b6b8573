#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace pencilscan {

/// A warning in plain words and what to do about it.
struct Advice {
  std::string warning;
  std::string action;  ///< may be empty
};

/// The warnings of a frame's report.json, with advice, and what its counts say beyond them: much
/// undecided, surface in shadow, lines too dense, open surface. Tolerates any JSON.
[[nodiscard]] std::vector<Advice> advise(const nlohmann::json& report);

}  // namespace pencilscan
