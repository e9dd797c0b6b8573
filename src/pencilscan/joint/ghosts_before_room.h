#pragma once

#include <span>

#include "pencilscan/joint/piece_labels.h"
#include "pencilscan/joint/stretches.h"
#include "pencilscan/rig/object_space.h"

namespace pencilscan {

/// Takes back names of pieces that would make a surface float before a room. Some code periods off,
/// lines of a wall agree with each other as well as at their place. But a surface before the room
/// ends where its curves end, and no curve of the room goes on over it or crosses one of its. So
/// pieces that cross at one depth or follow each other on a line are one patch, and a patch goes
/// whose pieces are continued or crossed by the room's lines more often than its curves end.
void leave_ghosts_before_room(const Camera& camera, const LabelledPieces& pieces,
                              const ObjectSpace& space, const JointOptions& options,
                              std::span<Decision> decisions);

}  // namespace pencilscan
