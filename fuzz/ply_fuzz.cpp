// PLY files: any, points, meshes, and curves.

#include "fuzz.h"
#include "pencilscan/io/curve_file.h"
#include "pencilscan/io/mesh_file.h"
#include "pencilscan/io/ply.h"
#include "pencilscan/labeling/point_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace pencilscan;
  using namespace pencilscan::fuzz;
  const auto path = put("input.ply", text_of(data, size));
  answered([&] { static_cast<void>(read_ply(path)); });
  answered([&] { static_cast<void>(read_points(path)); });
  answered([&] { static_cast<void>(read_curves(path)); });
  answered([&] { static_cast<void>(read_mesh(path)); });
  return 0;
}
