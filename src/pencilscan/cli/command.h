#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "pencilscan/cli/arguments.h"
#include "pencilscan/core/progress.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan::cli {

/// Options that every command has.
struct CommonOptions {
  int threads = 0;  ///< 0: all cores
  std::uint64_t seed = 1;
  std::string json_path;  ///< --json F: figures as JSON
};

/// Adds --threads, --seed, --json to a command, and an example to its help.
void add_common_options(CLI::App& command, CommonOptions& options, const std::string& example);
/// Adds --overwrite, without which no file is replaced: see refuse_existing(). Where nothing would
/// be written without the option `of`, which was added before, it is told to have no effect.
void add_overwrite(CLI::App& command, bool& overwrite, const std::string& text,
                   const CLI::Option* of = nullptr);

/// Progress on stderr, with the time that is probably left: a bar on a terminal, a line every few
/// seconds elsewhere. Ctrl-C prints a last line: how far it was, and `if_interrupted`, what that
/// means for the output.
[[nodiscard]] Progress stderr_progress(const std::string& if_interrupted = "");

/// Prints a warning to stderr, where there is one.
void warn_of(const std::optional<std::string>& warning);
/// Of a volume in another unit, and of poses and intrinsics of another convention.
void warn_of_rig(const Rig& rig);

/// Prints figures to stdout as aligned "key value" lines and writes --json when asked for.
void print_figures(const CommonOptions& options, const nlohmann::ordered_json& figures);
/// The second half of it: the figures, and before them their format, which tells --json what it may
/// replace.
void write_figures(const CommonOptions& options, const nlohmann::ordered_json& figures);

// One per command, each in its own <name>_command.cpp. They register a sub-command whose callback
// runs it; bad input is thrown as InputError, a failed stage as StageError, both caught in main().
void add_pattern_command(CLI::App& app);
void add_rig_command(CLI::App& app);
void add_simulate_command(CLI::App& app);
void add_calibrate_command(CLI::App& app);
void add_scan_command(CLI::App& app);
void add_reconstruct_command(CLI::App& app);
void add_sequence_command(CLI::App& app);
void add_evaluate_command(CLI::App& app);
void add_artefact_command(CLI::App& app);
void add_show_command(CLI::App& app);
void add_capture_command(CLI::App& app);
void add_lab_command(CLI::App& app);
void add_report_command(CLI::App& app);
void add_view_command(CLI::App& app);
void add_completion_command(CLI::App& app);
void add_manual_command(CLI::App& app);

}  // namespace pencilscan::cli
