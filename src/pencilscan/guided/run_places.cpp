#include "pencilscan/guided/run_places.h"

namespace pencilscan {

Places<RunPoint> places_of_runs(const Camera& camera, std::span<const Curve> curves,
                                std::span<const LabeledRun> runs,
                                const std::vector<char>& subtracted) {
  constexpr int kCellPx = 4;  // looked for within a few line widths
  Places<RunPoint> places(camera.width, camera.height, kCellPx);
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const auto curve = static_cast<std::size_t>(runs[r].curve);
    if (subtracted[curve] == 0) continue;
    for (int i = runs[r].begin; i < runs[r].end; ++i)
      places.add(curves[curve].points[static_cast<std::size_t>(i)].position, {r, i});
  }
  return places;
}

}  // namespace pencilscan
