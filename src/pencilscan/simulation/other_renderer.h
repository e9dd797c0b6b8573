#pragma once

#include <filesystem>
#include <string>

#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// InputError (naming the rig file) for what no other renderer shows of a rig: distorted cameras,
/// and colours that mix or are displaced. `option` asked for the export; `name`: the renderer.
void check_other_renderer_can_show(const Rig& rig, const std::filesystem::path& rig_path,
                                   const std::string& option, const std::string& name);

}  // namespace pencilscan
