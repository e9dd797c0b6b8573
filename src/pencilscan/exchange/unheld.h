#pragma once

#include <string>
#include <vector>

#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// What a rig states beside names, sizes, K, distortion, R and t: files of OpenCV and of COLMAP do
/// not hold it. Keys of rig.json, each once.
[[nodiscard]] std::vector<std::string> unheld_values(const Rig& rig);

/// InputError where a camera and a projector have the same name, which would be one file.
void require_distinct_names(const Rig& rig);

}  // namespace pencilscan
