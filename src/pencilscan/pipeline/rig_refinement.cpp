#include "pencilscan/pipeline/rig_refinement.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include "pencilscan/joint/joint.h"
#include "pencilscan/pipeline/disagreement_warnings.h"
#include "pencilscan/pipeline/lost_cameras.h"
#include "pencilscan/pipeline/lost_projectors.h"
#include "pencilscan/pipeline/naming_doubt.h"
#include "pencilscan/pipeline/view_agreement.h"
#include "pencilscan/refinement/moved_devices.h"

namespace pencilscan {
namespace {

std::vector<Labeling> label(const Rig& rig, std::span<const FrameCurves> frames,
                            const JointOptions& options) {
  std::vector<Labeling> labelings;
  for (const FrameCurves& frame : frames)
    labelings.push_back(solve_joint(rig, frame.families, frame.graphs, options));
  return labelings;
}

/// What one first tolerance leads to.
struct Attempt {
  RigCorrection correction;
  RigRefinement refinement;
  std::vector<CrossingTrack> tracks;  ///< of the last labels
  std::vector<std::size_t> moved;     ///< RefineRigOptions::moved
  bool agrees = false;
  std::string objection;  ///< what speaks against the names though crossings may meet
  std::optional<FoundProjector> misplaced;  ///< by the last names; it is the objection
  std::size_t points = 0;
};

/// Where few devices moved and all others are as calibrated, refinement starts with those put back.
void put_back_few(const Rig& calibrated, std::span<const CrossingTrack> tracks, Attempt& attempt) {
  constexpr std::size_t kFewOf = 4;
  const MovedDevices found = find_moved_devices(calibrated, tracks);
  const std::size_t devices = device_count(calibrated);
  if (found.moved.empty() || kFewOf * found.moved.size() > devices) return;
  attempt.correction = correction_of(found.moved, devices);
  for (const DeviceMove& move : found.moved) attempt.moved.push_back(move.device);
}

/// Labels and refines in turn, from a first tolerance down to the last one.
bool run_rounds(const Rig& calibrated, std::span<const FrameCurves> frames, double tolerance,
                const RigRefinementOptions& options, Attempt& result) {
  RigRefinement& refinement = result.refinement;
  // What the first labels' crossings leave open stays as given; the last ones may tell.
  RefineRigOptions refine = options.refine;
  refine.moved = result.moved;
  refine.max_remaining = std::numeric_limits<double>::infinity();
  const auto* chosen = std::get_if<JointOptions>(&options.points.method);
  JointOptions joint = chosen != nullptr ? *chosen : JointOptions{};
  const double last_tolerance = joint.projection_sigma_px;
  tolerance = std::max(tolerance, last_tolerance);
  while (true) {
    joint.projection_sigma_px = tolerance;
    const auto labelings = label(refinement.rig, frames, joint);
    const auto tracks = crossing_tracks(refinement.rig, frames, labelings, options.tracks);
    if (refinement.rounds.empty() && result.moved.empty()) {
      put_back_few(calibrated, tracks, result);
      refine.moved = result.moved;
    }
    RefineRigResult refined = refine_rig(calibrated, tracks, result.correction, refine);
    refinement.report = std::move(refined.report);
    if (!refinement.report.refined) return false;
    RefinementRound round{
        tolerance, tracks.size(), crossing_disagreement(refinement.rig, tracks), {}};
    result.correction = std::move(refined.correction);
    refinement.rig = corrected_rig(calibrated, result.correction);
    round.after = crossing_disagreement(refinement.rig, tracks);
    refinement.rounds.push_back(round);
    if (tolerance <= last_tolerance) break;
    constexpr double kTolerancePerMedian = 5;
    tolerance = std::max(last_tolerance,
                         std::min(0.5 * tolerance, kTolerancePerMedian * round.after.median_px));
  }
  refinement.labelings = label(refinement.rig, frames, joint);
  result.tracks = crossing_tracks(refinement.rig, frames, refinement.labelings, options.tracks);
  return true;
}

/// What speaks against the names of a refined rig, in plain words; empty: nothing. As a rig it has
/// to give every device names, and crossings that meet.
std::string objection(std::span<const FrameCurves> frames, const Attempt& attempt,
                      bool is_for_rig) {
  const Rig& rig = attempt.refinement.rig;
  const std::vector<Labeling>& labelings = attempt.refinement.labelings;
  const NamingDoubt doubt = naming_doubt(rig, frames, labelings);
  if (const std::string denied = doubt.denied(); !denied.empty())
    return "the colours of " + denied + " speak against its lines' names";
  if (const std::string camera = contradicted_camera(rig, frames, labelings); !camera.empty())
    return contradiction_text(camera);
  if (!is_for_rig) return {};
  if (const std::string unnamed = doubt.text(); !unnamed.empty()) return unnamed;
  const auto per_device = device_disagreements(rig, attempt.tracks);
  const auto off = device_that_is_off(per_device);
  return off ? misses_text(device_at(rig, *off), per_device[*off]) : std::string();
}

/// Turns projectors of whose lines all colours say that they are a few lines further. True where
/// there is one.
bool turn_by_colors(const Rig& calibrated, std::span<const FrameCurves> frames, Attempt& result) {
  bool turned = false;
  RigCorrection correction = result.correction;
  correction.resize(device_count(calibrated));
  for (const ShownColors& shown :
       naming_doubt(calibrated, frames, result.refinement.labelings).shown_colors()) {
    if (shown.better_shift() == 0) continue;
    const auto p = static_cast<std::size_t>(shown.pattern.projector);
    const LinePattern& lines =
        calibrated.projectors[p].patterns[static_cast<std::size_t>(shown.pattern.pattern)];
    const double way_px = shown.better_shift() * lines.pitch_px;
    const std::size_t device = calibrated.cameras.size() + p;
    // A turn about y moves the image along x, one about x moves it against y.
    correction[device].rotation_px +=
        lines.axis == Axis::kColumn ? Vec3(0, way_px, 0) : Vec3(-way_px, 0, 0);
    if (std::find(result.moved.begin(), result.moved.end(), device) == result.moved.end())
      result.moved.push_back(device);
    turned = true;
  }
  if (turned) {
    result.correction = correction;
    result.refinement.rig = corrected_rig(calibrated, correction);
  }
  return turned;
}

/// Where refinement begins: devices that stand far off where they are found.
struct Start {
  RigCorrection correction;  ///< empty: as calibrated
  std::vector<std::size_t> moved;
  std::vector<std::size_t> projectors;  ///< of those
};

void begin_at(std::size_t device, const PoseCorrection& correction, const Rig& calibrated,
              Start& start) {
  start.correction.resize(device_count(calibrated));
  start.correction[device] = correction;
  start.moved.push_back(device);
}

Start start_at_cameras(const Rig& calibrated, std::span<const FrameCurves> frames) {
  Start start;
  for (const FoundCamera& found :
       find_lost_cameras(calibrated, frames, label(calibrated, frames, JointOptions{})))
    begin_at(found.camera, found.correction, calibrated, start);
  return start;
}

Start start_at(std::size_t projector, const RigidTransform& pose, const Rig& calibrated) {
  Start start;
  begin_at(calibrated.cameras.size() + projector,
           correction_to(pose, calibrated.projectors[projector]), calibrated, start);
  start.projectors.push_back(projector);
  return start;
}

/// With the projector that the names of a refused rig find elsewhere; nothing: none, or names of
/// other lines fit as well.
std::optional<Start> start_at_misplaced(const Rig& calibrated, const Attempt& refused) {
  const std::optional<FoundProjector>& found = refused.misplaced;
  if (!found || found->is_ambiguous) return std::nullopt;
  const Projector& projector = refused.refinement.rig.projectors[found->projector];
  return start_at(found->projector, corrected_pose(projector, found->correction), calibrated);
}

/// With the projector that stands elsewhere by labels without it, of several the one that explains
/// most; nothing: none does, or names of other lines fit as well.
std::optional<Start> start_at_projector(const Rig& calibrated,
                                        std::span<const FrameCurves> frames) {
  std::optional<FoundProjector> most;
  for (const FoundProjector& found : find_projectors(calibrated, frames)) {
    if (found.is_elsewhere() && !found.is_ambiguous && (!most || found.gain > most->gain))
      most = found;
  }
  if (!most) return std::nullopt;
  const Projector& projector = calibrated.projectors[most->projector];
  return start_at(most->projector, corrected_pose(projector, most->correction), calibrated);
}

Attempt attempt(const Rig& calibrated, std::span<const FrameCurves> frames, double tolerance,
                const Start& start, const RigRefinementOptions& options) {
  Attempt result;
  result.correction = start.correction;
  result.moved = start.moved;
  result.refinement.rig = corrected_rig(calibrated, start.correction);
  if (!run_rounds(calibrated, frames, tolerance, options, result)) return result;
  if (turn_by_colors(calibrated, frames, result) &&
      !run_rounds(calibrated, frames, tolerance, options, result))
    return result;
  result.agrees = !disagrees(crossing_disagreement(result.refinement.rig, result.tracks));
  result.objection = objection(frames, result, options.is_for_rig);
  if (!result.objection.empty()) result.agrees = false;
  for (const Labeling& labeling : result.refinement.labelings)
    result.points += labelled_points(labeling);
  return result;
}

bool is_accepted(const Attempt& attempt) {
  return attempt.refinement.report.refined && attempt.objection.empty();
}

bool is_better(const Attempt& a, const Attempt& b) {
  if (a.agrees != b.agrees) return a.agrees;
  return a.points > b.points;
}

bool end_alike(const Attempt& a, const Attempt& b) {
  constexpr double kSame = 0.01;  // of the points
  const auto more = static_cast<double>(std::max(a.points, b.points));
  const auto fewer = static_cast<double>(std::min(a.points, b.points));
  return a.agrees && b.agrees && more - fewer < kSame * more;
}

/// The best of all first tolerances.
Attempt best_attempt(const Rig& calibrated, std::span<const FrameCurves> frames, const Start& start,
                     const RigRefinementOptions& options) {
  std::optional<Attempt> best;
  for (const double tolerance : options.first_tolerances_px) {
    Attempt next = attempt(calibrated, frames, tolerance, start, options);
    const bool is_settled = best && end_alike(*best, next);
    if (!best || is_better(next, *best)) best = std::move(next);
    if (is_settled) break;
  }
  if (options.is_for_rig && is_accepted(*best)) {
    const RigRefinement& refined = best->refinement;
    best->misplaced = misplaced_projector(refined.rig, frames, refined.labelings, start.projectors);
    if (best->misplaced) best->objection = misplaced_text(refined.rig, *best->misplaced);
  }
  return *std::move(best);
}

}  // namespace

std::vector<CrossingTrack> crossing_tracks(const Rig& rig, std::span<const FrameCurves> frames,
                                           std::span<const Labeling> labelings,
                                           const TrackOptions& options) {
  std::vector<CrossingTrack> tracks;
  for (std::size_t f = 0; f < frames.size(); ++f) {
    auto of_frame = crossing_tracks(rig, frames[f].graphs, labelings[f], options);
    std::move(of_frame.begin(), of_frame.end(), std::back_inserter(tracks));
  }
  return tracks;
}

RigRefinement refine_rig_on_frames(const Rig& stated, std::span<const FrameCurves> frames,
                                   const RigRefinementOptions& options) {
  const double unit = footprint(stated);
  const Rig calibrated = with_registered_patterns(scaled(stated, 1 / unit));
  Start start = options.is_for_rig ? start_at_cameras(calibrated, frames) : Start{};
  Attempt best = best_attempt(calibrated, frames, start, options);
  // Lines of a projector that was knocked have wrong names in all cameras.
  for (const bool by_names : {true, false}) {
    if (!options.is_for_rig || is_accepted(best)) break;
    std::optional<Start> other =
        by_names ? start_at_misplaced(calibrated, best) : start_at_projector(calibrated, frames);
    if (!other) continue;
    Attempt next = best_attempt(calibrated, frames, *other, options);
    if (!next.agrees || !is_accepted(next)) continue;
    best = std::move(next);
    start = *std::move(other);
  }
  RigRefinement result = std::move(best.refinement);
  result.found = start.correction;
  if (result.report.refined && !best.objection.empty()) {
    result.report.refined = false;
    result.report.reason = "though most crossings meet, " + best.objection +
                           ": it stands too far from where the rig has it; calibrate anew";
  }
  if (result.report.refined) {
    RefineRigOptions refine = options.refine;
    refine.moved = best.moved;
    RefineRigResult last = refine_rig(calibrated, best.tracks, best.correction, refine);
    result.report = std::move(last.report);
    if (result.report.refined) result.rig = corrected_rig(calibrated, last.correction);
  }
  if (result.report.refined) {
    result.rig = scaled(std::move(result.rig), unit);
  } else {
    result.rig = with_registered_patterns(stated);
    result.labelings.clear();
  }
  for (DeviceRefinement& device : result.report.devices) device.translation_mm *= unit;
  for (std::size_t p = 0; p < stated.projectors.size(); ++p) {
    result.rig.projectors[p].patterns = stated.projectors[p].patterns;
    result.rig.projectors[p].color_registration = stated.projectors[p].color_registration;
  }
  return result;
}

}  // namespace pencilscan
