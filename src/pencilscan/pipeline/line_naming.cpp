#include "pencilscan/pipeline/line_naming.h"

#include <array>
#include <cstdio>
#include <limits>
#include <utility>

#include "pencilscan/pipeline/rig_refinement.h"

namespace pencilscan {
namespace {

std::size_t labelled_points(const Labeling& labeling) {
  std::size_t count = 0;
  for (const auto& runs : labeling.runs) {
    for (const LabeledRun& run : runs) count += static_cast<std::size_t>(run.end - run.begin);
  }
  return count;
}

std::size_t curve_points(const std::vector<GridGraph>& graphs) {
  std::size_t count = 0;
  for (const GridGraph& graph : graphs) {
    for (const Curve& curve : graph.curves) count += curve.points.size();
  }
  return count;
}

CrossingDisagreement disagreement(const Rig& rig, const std::vector<GridGraph>& graphs,
                                  const Labeling& labeling) {
  return crossing_disagreement(rig, crossing_tracks(rig, graphs, labeling));
}

std::string disagreement_warning(const CrossingDisagreement& crossings, bool labels_are_corrected) {
  std::array<char, 400> text{};
  std::snprintf(
      text.data(), text.size(),
      "crossing lines miss each other by %.2f projector pixels (median) where image noise "
      "explains %.2f: the rig's calibration is off. %s; --refine-rig can correct %s",
      crossings.median_px, crossings.expected_px,
      labels_are_corrected ? "Lines were named with the devices as this frame corrects them, "
                             "points lie where the rig as given puts them"
                           : "This frame does not say how, many lines may be named wrong",
      labels_are_corrected ? "the points too" : "it from several frames");
  return text.data();
}

/// One way to correct the rig, and the labels that come of it.
struct Attempt {
  Rig rig;
  Labeling labeling;
  std::size_t points = 0;
};

/// The attempt that names most points, of those whose own crossings agree.
std::optional<Attempt> best_attempt(const Rig& rig, const FrameCurves& curves,
                                    const PointOptions& options) {
  constexpr std::array<double, 5> kFirstTolerancesPx = {2, 3, 4, 6, 1};
  constexpr double kSame = 0.01;  // of the points: two attempts that end in the same place
  std::optional<Attempt> best;
  for (const double tolerance : kFirstTolerancesPx) {
    RigRefinementOptions refinement;
    refinement.points = options;
    refinement.first_tolerance_px = tolerance;
    // Names need the rig only as far as the crossings tell; what they leave open stays as given.
    refinement.refine.max_remaining = std::numeric_limits<double>::infinity();
    RigRefinement found = refine_rig_on_frames(rig, {&curves, 1}, refinement);
    if (!found.report.refined) continue;
    Labeling labeling = solve(found.rig, curves.families, curves.graphs, options.solution);
    if (disagrees(disagreement(found.rig, curves.graphs, labeling))) continue;
    const std::size_t points = labelled_points(labeling);
    const double change =
        best ? static_cast<double>(points) / static_cast<double>(best->points) : 2;
    if (change > 1) best = Attempt{std::move(found.rig), std::move(labeling), points};
    if (change > 1 - kSame && change < 1 + kSame) break;
  }
  return best;
}

}  // namespace

LineNaming name_lines(const Rig& rig, const std::vector<ColorFamily>& families,
                      const std::vector<GridGraph>& graphs, const PointOptions& options) {
  constexpr double kNearlyAll = 0.8;         // of the curves' points; right names reach .9 and more
  constexpr double kClearlyMore = 1.1;       // points, of a rig that shows no error in itself
  constexpr std::size_t kFewCrossings = 30;  // say nothing about the devices
  LineNaming result;
  result.labeling = solve(rig, families, graphs, options.solution);
  result.crossings = disagreement(rig, graphs, result.labeling);
  const bool is_off = disagrees(result.crossings);
  const auto points = static_cast<double>(labelled_points(result.labeling));
  if (result.crossings.crossings < kFewCrossings) return result;
  if (!is_off && points > kNearlyAll * static_cast<double>(curve_points(graphs))) return result;
  std::optional<Attempt> best = best_attempt(rig, {families, graphs}, options);
  if (best && (is_off || static_cast<double>(best->points) > kClearlyMore * points)) {
    result.labeling = std::move(best->labeling);
    result.corrected = std::move(best->rig);
    result.crossings = disagreement(rig, graphs, result.labeling);
  }
  if (is_off || result.corrected)
    result.warning = disagreement_warning(result.crossings, result.corrected.has_value());
  return result;
}

}  // namespace pencilscan
