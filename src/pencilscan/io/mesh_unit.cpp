#include "pencilscan/io/mesh_unit.h"

#include <fstream>

namespace pencilscan {
namespace {

const char* unit_name(bool unit_known) { return unit_known ? "mm" : "unknown"; }

}  // namespace

std::string obj_unit(bool unit_known) {
  return std::string("# unit ") + unit_name(unit_known) + "\n";
}

std::string stl_unit(bool unit_known) {
  return std::string("binary STL, unit ") + unit_name(unit_known);
}

std::string ply_unit(bool unit_known) {
  return std::string("comment unit ") + unit_name(unit_known) + ",";
}

bool mesh_unit_known(const std::filesystem::path& path) {
  std::string head(256, '\0');  // what we write of the unit stands in the first lines
  std::ifstream file(path, std::ios::binary);
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(file.gcount()));
  return !head.starts_with(obj_unit(false)) && !head.starts_with(stl_unit(false)) &&
         !(head.starts_with("ply\n") && head.find("\n" + ply_unit(false)) != std::string::npos);
}

}  // namespace pencilscan
