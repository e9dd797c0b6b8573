#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

#include "pencilscan/pipeline/frame.h"

namespace pencilscan {

/// report.json of one frame: counts, residuals, components, warnings (docs/formats.md). Holds
/// nothing that varies between runs; times are in timing.json.
[[nodiscard]] nlohmann::ordered_json frame_report(const Rig& rig, const Frame& frame,
                                                  const PointResult& points,
                                                  const ShapeResult& shape);

/// Overlays of all detected curves per camera, `<camera>_local_id.png` and
/// `<camera>_projector.png`, and views of the shape with the devices.
void write_frame_pictures(const std::filesystem::path& folder, const Rig& rig, const Frame& frame,
                          const PointResult& points, const ShapeResult& shape);

}  // namespace pencilscan
