#include "pencilscan/pipeline/rig_explanation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "pencilscan/pipeline/disagreement_warnings.h"
#include "pencilscan/pipeline/line_naming.h"
#include "pencilscan/pipeline/lost_cameras.h"
#include "pencilscan/pipeline/lost_projectors.h"

namespace pencilscan {
namespace {

NamedCrossings named_crossings(const Rig& rig, std::span<const FrameCurves> frames,
                               std::span<const Labeling> labelings) {
  NamedCrossings result{crossing_tracks(rig, frames, labelings), 0,
                        naming_doubt(rig, frames, labelings)};
  std::size_t points = 0;
  std::size_t labelled = 0;
  for (std::size_t f = 0; f < frames.size(); ++f) {
    labelled += labelled_points(labelings[f]);
    for (const GridGraph& graph : frames[f].graphs) points += curve_points(graph);
  }
  if (points > 0)
    result.labelled_share = static_cast<double>(labelled) / static_cast<double>(points);
  return result;
}

bool are_alike(std::span<const DeviceMove> a, std::span<const DeviceMove> b, double shift_px) {
  return std::is_permutation(
      a.begin(), a.end(), b.begin(), b.end(), [&](const DeviceMove& x, const DeviceMove& y) {
        return x.device == y.device && std::abs(x.shift_px - y.shift_px) < shift_px;
      });
}

Explanation by_better_names(const Rig& rig, std::span<const FrameCurves> frames, Explanation best,
                            const MovedDevicesOptions& options) {
  constexpr int kMostRounds = 4;
  const auto look_for_contradictions = [&](Explanation& explanation) {
    explanation.contradicted =
        contradicted_camera(explanation.put_back, frames, explanation.labelings);
  };
  look_for_contradictions(best);
  for (int round = 1; round < kMostRounds && !best.found.moved.empty(); ++round) {
    Explanation next = explanation_of(rig, frames, labels_of(best.put_back, frames), options);
    look_for_contradictions(next);
    const bool stays = are_alike(next.found.moved, best.found.moved, options.smallest_px);
    if (next.named.labelled_share < best.named.labelled_share ||
        next.found.moved.size() > best.found.moved.size() ||
        (next.is_doubtful() && !best.is_doubtful()))
      break;
    best = std::move(next);
    if (stays) break;
  }
  return best;
}

}  // namespace

std::vector<Labeling> labels_of(const Rig& rig, std::span<const FrameCurves> frames) {
  std::vector<Labeling> labelings;
  for (const FrameCurves& frame : frames) {
    const PointOptions options;
    const SolutionMethod& method = solution_method(options.method);
    labelings.push_back(name_lines(rig, frame.families, frame.graphs,
                                   method.solve(rig, frame.families, frame.graphs, options.method),
                                   options)
                            .labeling);
  }
  return labelings;
}

Explanation explanation_of(const Rig& rig, std::span<const FrameCurves> frames,
                           std::vector<Labeling> labelings, const MovedDevicesOptions& options) {
  NamedCrossings named = named_crossings(rig, frames, labelings);
  MovedDevices found = find_moved_devices(rig, named.tracks, options);
  Rig put_back = corrected_rig(rig, correction_of(found.moved, device_count(rig)));
  auto left = device_disagreements(put_back, named.tracks);
  return {std::move(labelings),
          std::move(named),
          std::move(found),
          std::move(put_back),
          std::move(left),
          {},
          {}};
}

Explanation explain(const Rig& rig, std::span<const FrameCurves> frames, Explanation first,
                    const MovedDevicesOptions& options) {
  Explanation explained = by_better_names(rig, frames, std::move(first), options);
  if (!explained.is_doubtful()) {
    const auto found = misplaced_projector(explained.put_back, frames, explained.labelings);
    if (found) explained.misplaced = misplaced_text(rig, *found);
  }
  if (explained.is_doubtful() || device_that_is_off(explained.left)) {
    // A refined rig has no camera that the others contradict and no projector whose lines they
    // cross elsewhere, or it is refused.
    RigRefinementOptions refinement;
    refinement.refine.max_remaining = std::numeric_limits<double>::infinity();
    RigRefinement refined = refine_rig_on_frames(rig, frames, refinement);
    if (refined.report.refined) {
      MovedDevicesOptions from_found = options;
      from_found.start = std::move(refined.found);
      Explanation again = explanation_of(rig, frames, std::move(refined.labelings), from_found);
      if (!again.is_doubtful()) explained = std::move(again);
    }
  }
  return explained;
}

}  // namespace pencilscan
