#include "pencilscan/labeling/labeling.h"

#include <algorithm>

#include "pencilscan/geometry/light_sheet.h"

namespace pencilscan {

std::optional<Vec3> place_on_line(const Rig& rig, const Camera& camera, const Vec2& pixel,
                                  const CurveLabel& label) {
  const LinePattern& pattern = rig.pattern(label.pattern);
  const RayInProjector ray(camera, rig.projector(label.pattern.projector), pixel);
  const auto depth = ray.depth(pattern.position_px(label.plane), pattern.axis);
  if (!depth) return std::nullopt;
  return camera.point_at_depth(pixel, *depth);
}

std::size_t labelled_points(std::span<const LabeledRun> runs) {
  std::size_t count = 0;
  for (const LabeledRun& run : runs) count += static_cast<std::size_t>(run.end - run.begin);
  return count;
}

std::size_t labelled_points(const Labeling& labeling) {
  std::size_t count = 0;
  for (const auto& runs : labeling.runs) count += labelled_points(runs);
  return count;
}

void add_undecided(const UndecidedRun& run, std::vector<UndecidedRun>& undecided) {
  for (std::size_t k = 0, others = undecided.size(); k < others; ++k) {
    UndecidedRun& other = undecided[k];
    if (other.curve != run.curve || other.end <= run.begin || other.begin >= run.end) continue;
    const UndecidedRun after{other.curve, run.end, other.end, other.reason};
    other.end = std::max(other.begin, run.begin);
    if (after.begin < after.end) undecided.push_back(after);
  }
  std::erase_if(undecided, [](const UndecidedRun& other) { return other.begin == other.end; });
  undecided.push_back(run);
}

std::array<std::size_t, 4> undecided_points(std::span<const UndecidedRun> undecided,
                                            std::span<const LabeledRun> labelled) {
  std::array<std::size_t, 4> points{};
  std::vector<LabeledRun> by_curve(labelled.begin(), labelled.end());
  std::sort(by_curve.begin(), by_curve.end(),
            [](const LabeledRun& a, const LabeledRun& b) { return a.curve < b.curve; });
  const auto is_before = [](const LabeledRun& run, int curve) { return run.curve < curve; };
  for (const UndecidedRun& run : undecided) {
    int left = run.end - run.begin;
    for (auto other = std::lower_bound(by_curve.begin(), by_curve.end(), run.curve, is_before);
         other != by_curve.end() && other->curve == run.curve; ++other)
      left -= std::max(0, std::min(run.end, other->end) - std::max(run.begin, other->begin));
    points[static_cast<std::size_t>(run.reason)] += static_cast<std::size_t>(left);
  }
  return points;
}

}  // namespace pencilscan
