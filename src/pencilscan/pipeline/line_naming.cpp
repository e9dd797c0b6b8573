#include "pencilscan/pipeline/line_naming.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "pencilscan/pipeline/disagreement_warnings.h"
#include "pencilscan/pipeline/frame_warnings.h"
#include "pencilscan/pipeline/naming_doubt.h"
#include "pencilscan/pipeline/rig_refinement.h"

namespace pencilscan {
namespace {

TellingPoints telling_points(const Labeling& labeling) {
  TellingPoints sum;
  for (std::size_t c = 0; c < labeling.runs.size(); ++c) sum.add(telling_points(labeling, c));
  return sum;
}

/// What the crossings of the labels say, with the rig as given.
void judge(const Rig& rig, const std::vector<GridGraph>& graphs, LineNaming& naming) {
  const std::vector<CrossingTrack> tracks = crossing_tracks(rig, graphs, naming.labeling);
  naming.crossings = crossing_disagreement(rig, tracks);
  naming.device_crossings = naming.crossings.crossings > 0 ? device_disagreements(rig, tracks)
                                                           : std::vector<CrossingDisagreement>();
}

NamingDoubt doubt_of(const Rig& rig, const std::vector<ColorFamily>& families,
                     const std::vector<GridGraph>& graphs, const Labeling& labeling) {
  NamingDoubt doubt(rig);
  doubt.add(families, graphs, labeling);
  return doubt;
}

}  // namespace

TellingPoints telling_points(const Labeling& labeling, std::size_t camera) {
  const auto undecided = undecided_points(labeling.undecided[camera], labeling.runs[camera]);
  return {labelled_points(labeling.runs[camera]),
          undecided[static_cast<std::size_t>(UndecidedReason::kAmbiguous)] +
              undecided[static_cast<std::size_t>(UndecidedReason::kContradicted)]};
}

double least_named_share(const Labeling& labeling) {
  double least = 1;
  for (std::size_t c = 0; c < labeling.runs.size(); ++c) {
    const TellingPoints points = telling_points(labeling, c);
    if (points.are_enough()) least = std::min(least, points.named_share());
  }
  return least;
}

LineNaming name_lines(const Rig& rig, const std::vector<ColorFamily>& families,
                      const std::vector<GridGraph>& graphs, Labeling labeling,
                      const PointOptions& options, const std::function<bool()>& is_confirmed) {
  constexpr double kNearlyAll = 0.8;    // of the telling points; right names reach .9 and more
  constexpr double kAsClosely = 1.2;    // the misses that noise lets expect are known to a fifth
  constexpr double kClearlyMore = 1.1;  // points named, of those before
  constexpr double kAsWell = 1.2;       // crossings' misses, of those before
  constexpr double kClearlyLess = 0.8;  // the same
  LineNaming result;
  result.labeling = std::move(labeling);
  judge(rig, graphs, result);
  const bool is_off = disagrees(result.crossings);
  const auto points = static_cast<double>(labelled_points(result.labeling));
  if (!are_enough(result.crossings)) return result;
  const NamingDoubt doubt = doubt_of(rig, families, graphs, result.labeling);
  if (const std::string projectors = doubt.alike(); !projectors.empty())
    result.color_warning = alike_warning(projectors);
  const bool is_wrong = is_off || !doubt.denied().empty();
  // Where a projector stands far off, a frame alone keeps the points of the others, and says so.
  if (const std::string text = doubt.of_projectors(); !text.empty())
    result.warning = naming_warning(text);
  if (!is_wrong && points > kNearlyAll * static_cast<double>(telling_points(result.labeling).all()))
    return result;
  if (!is_wrong) {
    // Two of three signs of a right rig.
    const bool meets = result.crossings.median_px <= kAsClosely * result.crossings.expected_px;
    const bool are_named = least_named_share(result.labeling) > kMostNamed;
    if (meets && are_named) return result;
    if ((meets || are_named) && is_confirmed && is_confirmed()) return result;
  }

  const FrameCurves curves{families, graphs};
  RigRefinementOptions refinement;
  refinement.points = options;
  // Names need the rig only as far as the crossings tell; what they leave open stays as given.
  refinement.refine.max_remaining = std::numeric_limits<double>::infinity();
  // A frame alone leaves such a camera out and keeps the points of the others.
  refinement.is_for_rig = false;
  RigRefinement found = refine_rig_on_frames(rig, {&curves, 1}, refinement);
  if (found.report.refined) {
    Labeling& again = found.labelings.front();
    const CrossingDisagreement left =
        crossing_disagreement(found.rig, crossing_tracks(found.rig, graphs, again));
    const auto named = static_cast<double>(labelled_points(again));
    const double misses = left.median_px / result.crossings.median_px;
    const bool agrees = !disagrees(left);
    const bool names_more = named > kClearlyMore * points;
    // Curves that are themselves off their lines leave more than image noise explains, and wrong
    // names may meet as well as right ones: but they leave many curves without one.
    const bool is_better =
        (names_more && misses < kAsWell) || (named > points && misses < kClearlyLess);
    if (is_wrong ? agrees || is_better : agrees && names_more) {
      result.labeling = std::move(again);
      result.corrected = std::move(found.rig);
      result.rig_in_frame = agrees ? RigInFrame::kCorrected : RigInFrame::kPartlyCorrected;
      judge(rig, graphs, result);
    }
  }
  if (deny_rig(result.crossings, share_of_named_points(graphs, result.labeling)) ||
      result.corrected)
    result.warning = rig_warning(result.crossings, result.rig_in_frame);
  return result;
}

}  // namespace pencilscan
