#pragma once

#include <nlohmann/json_fwd.hpp>
#include <ostream>

namespace pencilscan::cli {

/// The figures of `evaluate` (figures_json()) for people: every key with its value and what it
/// means in a few words, then a table each of what is counted by confidence, projector and spacing.
void print_evaluation(const nlohmann::ordered_json& figures, std::ostream& out);

}  // namespace pencilscan::cli
