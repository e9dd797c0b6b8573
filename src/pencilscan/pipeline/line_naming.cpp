#include "pencilscan/pipeline/line_naming.h"

#include <array>
#include <cstdio>
#include <limits>
#include <utility>

#include "pencilscan/pipeline/rig_refinement.h"

namespace pencilscan {
namespace {

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

}  // namespace

LineNaming name_lines(const Rig& rig, const std::vector<ColorFamily>& families,
                      const std::vector<GridGraph>& graphs, Labeling labeling,
                      const PointOptions& options) {
  constexpr double kNearlyAll = 0.8;    // of the curves' points; right names reach .9 and more
  constexpr double kClearlyMore = 1.1;  // points named, of those before
  constexpr double kAsWell = 1.2;       // crossings' misses, of those before
  constexpr double kClearlyLess = 0.8;  // the same
  LineNaming result;
  const SolutionMethod& method = solution_method(options.method);
  result.labeling = std::move(labeling);
  if (!method.capabilities.corrects_rig) return result;
  result.crossings = disagreement(rig, graphs, result.labeling);
  const bool is_off = disagrees(result.crossings);
  const auto points = static_cast<double>(labelled_points(result.labeling));
  if (!are_enough(result.crossings)) return result;
  if (!is_off && points > kNearlyAll * static_cast<double>(curve_points(graphs))) return result;

  const FrameCurves curves{families, graphs};
  RigRefinementOptions refinement;
  refinement.points = options;
  // Names need the rig only as far as the crossings tell; what they leave open stays as given.
  refinement.refine.max_remaining = std::numeric_limits<double>::infinity();
  RigRefinement found = refine_rig_on_frames(rig, {&curves, 1}, refinement);
  if (found.report.refined) {
    Labeling& again = found.labelings.front();
    const CrossingDisagreement left = disagreement(found.rig, graphs, again);
    const auto named = static_cast<double>(labelled_points(again));
    const double misses = left.median_px / result.crossings.median_px;
    const bool agrees = !disagrees(left);
    const bool names_more = named > kClearlyMore * points;
    // Curves that are themselves off their lines leave more than image noise explains, and wrong
    // names may meet as well as right ones: but they leave many curves without one.
    const bool is_better =
        (names_more && misses < kAsWell) || (named > points && misses < kClearlyLess);
    if (is_off ? agrees || is_better : agrees && names_more) {
      result.labeling = std::move(again);
      result.corrected = std::move(found.rig);
      result.crossings = disagreement(rig, graphs, result.labeling);
    }
  }
  if (is_off || result.corrected)
    result.warning = disagreement_warning(result.crossings, result.corrected.has_value());
  return result;
}

}  // namespace pencilscan
