#pragma once

#include <filesystem>
#include <string>

namespace pencilscan {

/// What a mesh file says of its unit: the first line of .obj, the beginning of .stl, and that of a
/// line of .ply.
[[nodiscard]] std::string obj_unit(bool unit_known);
[[nodiscard]] std::string stl_unit(bool unit_known);
[[nodiscard]] std::string ply_unit(bool unit_known);

/// False where a mesh file says that its unit is unknown, as write_mesh() and export_mesh() write
/// it without `unit_known`; what it says of .ply, .obj and .stl is read. True of any other file.
[[nodiscard]] bool mesh_unit_known(const std::filesystem::path& path);

}  // namespace pencilscan
