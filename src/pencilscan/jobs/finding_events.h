#pragma once

#include <span>
#include <vector>

#include "pencilscan/jobs/watch.h"

namespace pencilscan {

/// What frames say themselves, per code and device: from the first frame that says it to the last
/// one. What comes again within 15 frames that are done, the memory of changes.h, is one event,
/// whose text tells how many of its frames say it. What all frames say of no device belongs to the
/// recording and is none.
[[nodiscard]] std::vector<SequenceEvent> finding_events(std::span<const FrameRow> rows);

}  // namespace pencilscan
