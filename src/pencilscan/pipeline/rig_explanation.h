#pragma once

#include <span>
#include <string>
#include <vector>

#include "pencilscan/pipeline/naming_doubt.h"
#include "pencilscan/refinement/moved_devices.h"

namespace pencilscan {

/// What the labels of frames say.
struct NamedCrossings {
  std::vector<CrossingTrack> tracks;
  double labelled_share = 0;
  NamingDoubt doubt;
};

/// Names of lines, and the devices that have to be put back for their crossings to meet.
struct Explanation {
  std::vector<Labeling> labelings;
  NamedCrossings named;
  MovedDevices found;
  Rig put_back;
  std::vector<CrossingDisagreement> left;  ///< per device, with the rig put back
  std::string contradicted;  ///< a camera that measures what the others do not; empty: none
  std::string misplaced;     ///< misplaced_text() of a projector; empty: none

  [[nodiscard]] bool is_doubtful() const {
    return !contradicted.empty() || !misplaced.empty() || !named.doubt.text().empty();
  }
};

/// The names of each frame's lines, as `reconstruct` gives them: with corrected devices where the
/// rig is off. The rig's lengths are in footprints.
[[nodiscard]] std::vector<Labeling> labels_of(const Rig& rig, std::span<const FrameCurves> frames);

/// What moved by these names. The rig must outlive the explanation.
[[nodiscard]] Explanation explanation_of(const Rig& rig, std::span<const FrameCurves> frames,
                                         std::vector<Labeling> labelings,
                                         const MovedDevicesOptions& options);

/// Begins with what moved by the first names, then names lines with that put back, and so on, as
/// long as more lines have names and no more devices are accused: names that a device has from a
/// wrong place draw it to where they are right, and others with it. Where doubts remain, all frames
/// together, colours, and where lines cross may tell where a device stands.
[[nodiscard]] Explanation explain(const Rig& rig, std::span<const FrameCurves> frames,
                                  Explanation first, const MovedDevicesOptions& options);

}  // namespace pencilscan
