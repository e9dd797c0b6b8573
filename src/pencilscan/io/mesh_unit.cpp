#include "pencilscan/io/mesh_unit.h"

#include <fstream>
#include <string>

namespace pencilscan {

bool mesh_unit_known(const std::filesystem::path& path) {
  std::string head(256, '\0');  // what we write of the unit stands in the first lines
  std::ifstream file(path, std::ios::binary);
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(file.gcount()));
  return !head.starts_with("# unit unknown\n") && !head.starts_with("binary STL, unit unknown") &&
         !(head.starts_with("ply\n") && head.find("\ncomment unit unknown,") != std::string::npos);
}

}  // namespace pencilscan
