#pragma once

#include <filesystem>

namespace pencilscan {

/// False where a mesh file says that its unit is unknown, as write_mesh() and export_mesh() write
/// it without `unit_known`; what it says of .ply, .obj and .stl is read. True of any other file.
[[nodiscard]] bool mesh_unit_known(const std::filesystem::path& path);

}  // namespace pencilscan
