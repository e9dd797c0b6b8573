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
  for (const double tolerance : options.tolerances_px) {
    JointOptions joint = options.points.solution.joint;
    joint.projection_sigma_px = std::max(joint.projection_sigma_px, tolerance);
    std::vector<CrossingTrack> tracks;
    for (const FrameCurves& frame : frames) {
      const Labeling labeling = solve_joint(result.rig, frame.families, frame.graphs, joint);
      auto of_frame = crossing_tracks(result.rig, frame.graphs, labeling, options.tracks);
      std::move(of_frame.begin(), of_frame.end(), std::back_inserter(tracks));
    }
    RefinementRound round{tolerance, tracks.size(), crossing_disagreement(result.rig, tracks), {}};
    RefineRigResult refined = refine_rig(calibrated, tracks, correction, options.refine);
    result.report = std::move(refined.report);
    if (!result.report.refined) {
      result.rig = calibrated;
      return result;
    }
    correction = std::move(refined.correction);
    result.rig = corrected_rig(calibrated, correction);
    round.after = crossing_disagreement(result.rig, tracks);
    result.rounds.push_back(round);
  }
  return result;
}

}  // namespace pencilscan
