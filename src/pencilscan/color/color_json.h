#pragma once

#include <nlohmann/json_fwd.hpp>

#include "pencilscan/color/color_calibration.h"

namespace pencilscan {

/// For calibration.json.
[[nodiscard]] nlohmann::ordered_json color_json(const Rig& rig, const ColorCalibration& color);

}  // namespace pencilscan
