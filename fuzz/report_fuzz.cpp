// Output folders: one file of a good result is replaced by the input (its first byte says which),
// and the folder becomes a page.

#include <array>
#include <string_view>

#include "fuzz.h"
#include "pencilscan/page/page.h"
#include "pencilscan/page/sample_result.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace pencilscan;
  using namespace pencilscan::fuzz;
  namespace fs = std::filesystem;
  /// A file, and the part of the page that it is the only input of; empty: of all.
  struct File {
    const char* name;
    std::string_view part;
  };
  static const std::array<File, 11> kFiles = {{{"000000/report.json", "details"},
                                               {"000000/timing.json", "details"},
                                               {"000000/curves.ply", "curves"},
                                               {"000000/points.ply", "points"},
                                               {"000000/mesh.ply", "mesh"},
                                               {"000000/evaluation.json", "details"},
                                               {"calibration.json", "index"},
                                               {"experiment.json", "index"},
                                               {"table.md", "index"},
                                               {"values.csv", "index"},
                                               {"devices.json", ""}}};
  static const bool prepared = [] {
    sample::write_output(scratch() / "out", 1);
    return true;
  }();
  static_cast<void>(prepared);
  Choices choices(text_of(data, size));
  const File& chosen = kFiles[choices.below(kFiles.size())];
  const fs::path file = scratch() / "out" / chosen.name;
  const fs::path kept = scratch() / "kept";
  std::error_code ignored;
  fs::remove(kept, ignored);
  if (fs::exists(file)) fs::rename(file, kept);
  put(std::string("out/") + chosen.name, choices.rest());
  answered([&] {
    const PageData page(scratch() / "out", {});
    Detail detail;
    detail.max_faces = 100;
    detail.point_stride = 50;
    for (std::size_t r = 0; r < page.size(); ++r) {
      const auto reader = page.open(r, detail);
      for (const char* part : {"details", "points", "curves", "mesh"})
        if (chosen.part.empty() || chosen.part == part) static_cast<void>(reader->part(part));
      static_cast<void>(page.entry(r, *reader, reader->part_names()));
    }
    const auto experiment = page.experiment({});
    static_cast<void>(served_page(
        page.index("report", {}, experiment ? experiment->json : nlohmann::ordered_json())));
  });
  fs::remove(file, ignored);
  if (fs::exists(kept)) fs::rename(kept, file);
  return 0;
}
