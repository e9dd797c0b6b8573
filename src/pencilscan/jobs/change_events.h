#pragma once

#include <span>
#include <string>
#include <vector>

#include "pencilscan/jobs/watched_changes.h"

namespace pencilscan {

// What is said of changes, in plain words.

/// Of one figure of one device.
[[nodiscard]] SequenceEvent event_of(std::span<const FrameRow> rows, const SequenceDevices& devices,
                                     const FoundChange& found);

/// The same change in most cameras, or most projectors, at once is one event, of none of them.
[[nodiscard]] SequenceEvent event_of_all(std::span<const FrameRow> rows,
                                         const SequenceDevices& devices,
                                         const std::vector<FoundChange>& together);

/// Which device made crossings miss each other, or meet again. One camera alone, be it that its
/// crossings miss or that its picture is shifted: that one, since a crossing's disagreement is that
/// of one camera with two projectors. Several: the projector whose crossings suffer most, if there
/// is one; of two projectors every crossing is of both.
[[nodiscard]] SequenceEvent event_of_crossings(std::span<const FrameRow> rows,
                                               const SequenceDevices& devices,
                                               std::vector<FoundChange> together);

/// Cameras that hung.
[[nodiscard]] std::vector<SequenceEvent> repetitions_of(std::span<const FrameRow> rows,
                                                        const SequenceDevices& devices);

}  // namespace pencilscan
