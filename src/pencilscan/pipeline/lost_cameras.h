#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/pipeline/pose_search.h"
#include "pencilscan/pipeline/rig_refinement.h"
#include "pencilscan/pipeline/view_agreement.h"
#include "pencilscan/refinement/correction.h"

namespace pencilscan {

// A camera that was knocked stands farther from where the rig has it than its lines are apart. Its
// crossings cannot tell where it is: its names are those of other lines. The other cameras still
// measure the surface, and with it where every line lies in space. The camera is looked for where
// these lines lie on curves of their colours in its picture.

/// A camera, and where it stands.
struct FoundCamera {
  std::size_t camera = 0;
  PoseCorrection correction;
  double share = 0;  ///< of the places on lines that it should see, those that it does see
};

/// What each camera's points, by the labels of all frames, say of those of the others.
[[nodiscard]] std::vector<PairAgreement> agreement_of_cameras(const Rig& rig,
                                                              std::span<const FrameCurves> frames,
                                                              std::span<const Labeling> labelings);

/// Name of the camera most of whose points lie in front of or behind what the others measured: it
/// has the names of other lines, at which crossings and colours agree. Empty: none.
[[nodiscard]] std::string contradicted_camera(const Rig& rig, std::span<const FrameCurves> frames,
                                              std::span<const Labeling> labelings);
[[nodiscard]] std::string contradiction_text(const std::string& camera);

/// Cameras few of whose curves have names in `labelings`, or the wrong ones by their colours, that
/// are found elsewhere; where there are none, the one of those that contradict others which is
/// found best. `rig`: in footprints, with registered patterns; a labeling per frame.
[[nodiscard]] std::vector<FoundCamera> find_lost_cameras(const Rig& rig,
                                                         std::span<const FrameCurves> frames,
                                                         std::span<const Labeling> labelings,
                                                         const PoseSearchOptions& options = {});

}  // namespace pencilscan
