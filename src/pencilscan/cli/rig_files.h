#pragma once

#include "pencilscan/cli/command.h"

namespace pencilscan::cli {

/// `rig import`, `rig export` and `rig picture`.
void add_rig_files(CLI::App& group);

}  // namespace pencilscan::cli
