#pragma once

#include <vector>

#include "pencilscan/joint/anchors.h"
#include "pencilscan/rig/object_space.h"

namespace pencilscan {

/// Gives the room what may be of the room. Where one projector alone lights a wall, nothing
/// crosses. Its lines vouch for each other as well some code periods off, at places in the air. So
/// a group of linked pieces that nothing holds, and that has a name in the object's space, is
/// compared with its other readings: lines of any pattern, all the same number of lines away. Each
/// piece counts with its own cost and with what the held pieces around and other cameras say
/// (`known`, per piece and label). What the group's pieces say of each other does not count. A
/// piece that cannot show a reading costs as much as a wrong colour.
///   1. Where a reading has no piece in the object's space and costs less than half a wrong colour
///      more, the group gets it. Of several, it gets the one of least cost. So depth and guided
///      matching know that the room explains these curves.
///   2. Else the margins of its pieces are at most what the other readings cost more.
void give_to_room(const Camera& camera, const LabelledPieces& pieces, const Anchors& anchors,
                  const std::vector<std::vector<float>>& known, const ObjectSpace& space,
                  const JointOptions& options, std::vector<Decision>& decisions);

}  // namespace pencilscan
