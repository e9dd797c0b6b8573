#pragma once

#include <span>
#include <vector>

#include "pencilscan/pipeline/frame.h"
#include "pencilscan/refinement/refine_rig.h"

namespace pencilscan {

struct RigRefinementOptions {
  PointOptions points;
  /// Tolerances of the labels in the first round, projector px: about the error of a line with the
  /// rig as given. Each later round takes half of it or what the crossings then show; the last one
  /// is that of the joint method. Labels and rig can be wrong together and agree, but only the
  /// right ones name nearly all curves: of what the tolerances lead to, the one that names most
  /// points is taken. Two that name equally many end the search. Not empty.
  std::vector<double> first_tolerances_px = {2, 3, 4, 6, 1};
  TrackOptions tracks;
  RefineRigOptions refine;
  /// The rig is wanted, not only names for the lines of one frame. Then cameras that stand far off
  /// are looked for first (lost_cameras.h). A rig is refused in which one device's crossings still
  /// miss each other by far more than noise (disagreement_warnings.h), or a projector's lines cross
  /// those of others elsewhere. Of a refused one a projector that stands far off is looked for
  /// (lost_projectors.h).
  bool is_for_rig = true;
};

/// Labels and refinement at one tolerance.
struct RefinementRound {
  double tolerance_px = 0;
  std::size_t tracks = 0;
  CrossingDisagreement before;  ///< with the rig that the labels were made of
  CrossingDisagreement after;
};

struct RigRefinement {
  Rig rig;                 ///< as given where report.refined is false
  RefineRigReport report;  ///< of the last round; "before" is the calibration as given
  std::vector<RefinementRound> rounds;
  RigCorrection found;  ///< of devices that stood far off, where they were found; empty: none
  std::vector<Labeling> labelings;  ///< per frame, with the corrected rig; empty where not refined
};

/// Curves of one frame: what refinement needs of its images.
struct FrameCurves {
  std::vector<ColorFamily> families;
  std::vector<GridGraph> graphs;  ///< per camera
};

/// Crossings of the labelled lines of several frames, a labeling per frame.
[[nodiscard]] std::vector<CrossingTrack> crossing_tracks(const Rig& rig,
                                                         std::span<const FrameCurves> frames,
                                                         std::span<const Labeling> labelings,
                                                         const TrackOptions& options = {});

/// Corrects the poses of the devices so that the crossings of labelled lines of all frames agree:
/// joint labels with a wide tolerance, refinement of the rig, labels with a narrower one, and so
/// on. Refused where the crossings of the last labels do not determine the devices.
[[nodiscard]] RigRefinement refine_rig_on_frames(const Rig& calibrated,
                                                 std::span<const FrameCurves> frames,
                                                 const RigRefinementOptions& options = {});

}  // namespace pencilscan
