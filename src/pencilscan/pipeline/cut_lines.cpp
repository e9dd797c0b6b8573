#include "pencilscan/pipeline/cut_lines.h"

#include <algorithm>
#include <vector>

#include "pencilscan/joint/joint_options.h"
#include "pencilscan/rig/object_space.h"

namespace pencilscan {
namespace {

/// How far a curve is followed from where its name ends, points. Names are given to pieces, to
/// those whose middle is seen in the volume: the next one's end lies beyond.
const int kAhead = JointOptions{}.piece_length;

class Cuts {
 public:
  Cuts(const Rig& rig, const GridGraph& graph)
      : rig_(rig),
        graph_(graph),
        camera_(rig.camera(graph.camera)),
        space_(rig),
        volume_(space_.with_floor()),
        least_height_(line_spacing(rig)) {}

  /// `runs`: of one curve, in the order of its points.
  void count(std::span<const LabeledRun> runs, CutLines& lines) const {
    const Curve& curve = graph_.curves[static_cast<std::size_t>(runs.front().curve)];
    bool is_inside = false;
    bool is_beyond = false;
    bool is_below = false;
    for (std::size_t k = 0; k < runs.size(); ++k) {
      const LabeledRun& run = runs[k];
      const int first = std::max(run.begin - kAhead, k == 0 ? 0 : runs[k - 1].end);
      const int end =
          std::min(run.end + kAhead, k + 1 == runs.size() ? static_cast<int>(curve.points.size())
                                                          : runs[k + 1].begin);
      for (const int point : {first, run.begin, (run.begin + run.end) / 2, run.end - 1, end - 1}) {
        const Vec2 pixel = curve.points[static_cast<std::size_t>(point)].position.cast<double>();
        const auto x = place_on_line(rig_, camera_, pixel, run.label);
        if (!x) continue;
        const bool is_held = space_.holds(*x);
        is_inside |= is_held;
        is_below |= rig_.floor && rig_.floor->height(*x) < -least_height_ && volume_.holds(*x);
        is_beyond |= !is_held && (!rig_.floor || rig_.floor->height(*x) > least_height_);
      }
    }
    if (is_inside) ++lines.inside;
    if (is_inside && is_beyond) ++lines.cut;
    if (is_inside && is_below) ++lines.below_floor;
  }

 private:
  const Rig& rig_;
  const GridGraph& graph_;
  const Camera& camera_;
  ObjectSpace space_;
  ObjectSpace volume_;  ///< the same below the floor
  double least_height_;
};

}  // namespace

CutLines cut_lines(const Rig& rig, std::span<const GridGraph> graphs, const Labeling& labeling) {
  CutLines lines;
  for (const GridGraph& graph : graphs) {
    const Cuts cuts(rig, graph);
    std::vector<LabeledRun> runs = labeling.runs[static_cast<std::size_t>(graph.camera)];
    std::sort(runs.begin(), runs.end(), [](const LabeledRun& a, const LabeledRun& b) {
      return a.curve != b.curve ? a.curve < b.curve : a.begin < b.begin;
    });
    for (std::size_t first = 0; first < runs.size();) {
      std::size_t end = first + 1;
      while (end < runs.size() && runs[end].curve == runs[first].curve) ++end;
      cuts.count(std::span(runs).subspan(first, end - first), lines);
      first = end;
    }
  }
  return lines;
}

}  // namespace pencilscan
