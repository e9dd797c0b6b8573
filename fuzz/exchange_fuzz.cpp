// Rigs of other programs: an OpenCV file (first byte y or x: YAML or XML), or the three files of a
// COLMAP model (first byte c; the files between bytes 0).

#include "fuzz.h"
#include "pencilscan/exchange/colmap_model.h"
#include "pencilscan/exchange/opencv_file.h"
#include "pencilscan/rig/rig_text.h"

namespace pencilscan::fuzz {
namespace {

void join(ExchangedRig files) {
  // Files of calibrations often lack the size, which people give beside them.
  for (ExchangedDevice& d : files.devices) {
    if (d.device.width <= 0) d.device.width = 640;
    if (d.device.height <= 0) d.device.height = 480;
  }
  static_cast<void>(join_rig(std::move(files), {}));
}

}  // namespace
}  // namespace pencilscan::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace pencilscan;
  using namespace pencilscan::fuzz;
  Choices parts(text_of(data, size));
  const std::uint8_t kind = parts.byte();
  if (kind == 'c') {
    static const bool prepared = std::filesystem::create_directories(scratch() / "model");
    static_cast<void>(prepared);
    put("model/cameras.txt", parts.part());
    put("model/images.txt", parts.part());
    put("model/points3D.txt", parts.rest());
    answered([&] { join(read_colmap(scratch() / "model")); });
  } else if (kind == 'x' || kind == 'y') {
    const auto path = put(kind == 'x' ? "input.xml" : "input.yml", parts.rest());
    answered([&] {
      ExchangedRig rig;
      read_opencv(path, {}, rig);
      join(std::move(rig));
    });
  }
  return 0;
}
