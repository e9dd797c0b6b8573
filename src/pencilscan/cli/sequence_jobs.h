#pragma once

#include <CLI/CLI.hpp>

namespace pencilscan::cli {

/// `sequence submit` and `sequence finish`.
void add_sequence_jobs(CLI::App& group);
/// `sequence export`.
void add_sequence_export(CLI::App& group);

}  // namespace pencilscan::cli
