#include "pencilscan/pipeline/rig_refinement.h"

#include <algorithm>
#include <utility>

#include "pencilscan/solution/joint.h"

namespace pencilscan {

RigRefinement refine_rig_on_frames(const Rig& calibrated, std::span<const FrameCurves> frames,
                                   const RigRefinementOptions& options) {
  RigRefinement result;
  result.rig = calibrated;
  RigCorrection correction;
  const double last_tolerance = options.points.solution.joint.projection_sigma_px;
  double tolerance = std::max(options.first_tolerance_px, last_tolerance);
  while (true) {
    JointOptions joint = options.points.solution.joint;
    joint.projection_sigma_px = tolerance;
    std::vector<CrossingTrack> tracks;
    for (const FrameCurves& frame : frames) {
      const Labeling labeling = solve_joint(result.rig, frame.families, frame.graphs, joint);
      auto of_frame = crossing_tracks(result.rig, frame.graphs, labeling, options.tracks);
      std::move(of_frame.begin(), of_frame.end(), std::back_inserter(tracks));
    }
    RefineRigResult refined = refine_rig(calibrated, tracks, correction, options.refine);
    result.report = std::move(refined.report);
    if (!result.report.refined) {
      result.rig = calibrated;
      return result;
    }
    RefinementRound round{tolerance, tracks.size(), crossing_disagreement(result.rig, tracks), {}};
    correction = std::move(refined.correction);
    result.rig = corrected_rig(calibrated, correction);
    round.after = crossing_disagreement(result.rig, tracks);
    result.rounds.push_back(round);
    if (tolerance <= last_tolerance) return result;
    constexpr double kTolerancePerMedian = 5;
    tolerance = std::max(last_tolerance,
                         std::min(0.5 * tolerance, kTolerancePerMedian * round.after.median_px));
  }
}

}  // namespace pencilscan
