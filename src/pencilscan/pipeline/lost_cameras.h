#pragma once

#include <cstddef>
#include <optional>
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

/// A camera that stands so little off that many of its lines still get names, of other lines.
struct TurnedCamera {
  std::size_t camera = 0;
  double shift_px = 0;     ///< of its picture, median over the places on lines that it should see
  double median_px = 0;    ///< of these from its nearest line of their colour
  double expected_px = 0;  ///< the same after the turn
  std::size_t places = 0;
  std::size_t won = 0;   ///< of these, on a line after the turn and not as the rig has it
  std::size_t lost = 0;  ///< the other way round
};

/// The one camera whose curves lie beside the lines that the others measured, in one frame, as far
/// as a line spacing to each side, and on them after a turn; nothing where there are several, or
/// where no two other cameras show that they agree. A camera whose crossings meet where it stands
/// is not among them: its picture is of another moment. `rig`: in footprints, with registered
/// patterns; `device_crossings`: of the labels.
[[nodiscard]] std::optional<TurnedCamera> turned_camera(
    const Rig& rig, const std::vector<ColorFamily>& families, const std::vector<GridGraph>& graphs,
    const Labeling& labeling, std::span<const CrossingDisagreement> device_crossings);

}  // namespace pencilscan
