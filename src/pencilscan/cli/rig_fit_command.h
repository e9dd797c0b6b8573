#pragma once

#include <string>

#include "pencilscan/cli/command.h"

namespace pencilscan::cli {

/// What `rig check --frames` was asked for.
struct RigFitCommand {
  std::string frames;
  std::size_t frame_count = 8;  ///< that are looked at, evenly picked
  std::string put_back;         ///< where the rig with what moved put back is written; or empty
  bool overwrite = false;       ///< what is there under that name
};

void add_rig_fit_options(CLI::App& command, RigFitCommand& options);
/// StageError when the rig does not fit, or that cannot be told.
void run_rig_fit(const CommonOptions& common, const std::string& rig_path,
                 const RigFitCommand& options);

}  // namespace pencilscan::cli
