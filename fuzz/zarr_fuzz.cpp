// Zarr: the metadata of an array and one chunk of it (parts between bytes 0), alone and as a
// recording of one camera.

#include "fuzz.h"
#include "pencilscan/io/zarr_array.h"
#include "pencilscan/recording/frame_sets.h"
#include "pencilscan/recording/recording.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace pencilscan;
  using namespace pencilscan::fuzz;
  namespace fs = std::filesystem;
  Choices parts(text_of(data, size));
  static const bool prepared = [] {
    fs::create_directories(scratch() / "r" / "cam0");
    put("r/.zgroup", R"({"zarr_format": 2})");
    return true;
  }();
  static_cast<void>(prepared);
  const std::string_view array = parts.part();
  const std::string_view attributes = parts.part();
  put("r/cam0/.zarray", array);
  put("r/.zattrs", attributes);
  for (const char* chunk : {"r/cam0/0.0.0", "r/cam0/0.0", "r/cam0/0.0.0.0"})
    put(chunk, parts.rest());
  answered([&] {
    const ZarrArray read = read_zarr_array(scratch() / "r" / "cam0");
    const std::vector<std::int64_t> first(read.shape.size(), 0);
    static_cast<void>(read_zarr_chunk(scratch() / "r" / "cam0", read, first));
  });
  answered([&] { static_cast<void>(read_zarr_group(scratch() / "r")); });
  answered([&] {
    const Recording recording = Recording::open(scratch() / "r");
    static_cast<void>(group_frames(recording));
    if (!recording.cameras().empty()) static_cast<void>(recording.read(0, 0));
  });
  return 0;
}
