#pragma once

#include <filesystem>
#include <vector>

#include "pencilscan/labeling/measured_point.h"

namespace pencilscan {

/// Writes points.ply, binary little endian, whole or not at all. The property `pattern` is written
/// always, normals and colours where some point has one. `unit_known`: as the rig has it; else the
/// file says "unit unknown".
void write_points(const std::filesystem::path& path, const std::vector<MeasuredPoint>& points,
                  bool unit_known = true);
/// Reads any points.ply with at least x y z u v camera projector line, in any order and with more
/// properties; missing sigma, confidence, pattern, plane get 0, 1, 0, line. Normals and colours are
/// not read. InputError otherwise.
[[nodiscard]] std::vector<MeasuredPoint> read_points(const std::filesystem::path& path);

}  // namespace pencilscan
