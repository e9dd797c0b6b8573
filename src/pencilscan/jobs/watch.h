#pragma once

#include <span>
#include <string>
#include <vector>

#include "pencilscan/jobs/frame_rows.h"

namespace pencilscan {

/// Something became different and stayed so.
struct SequenceEvent {
  std::string frame;   ///< the first one that is different
  std::string kind;    ///< "crossings", "labelled", "width", "height", "level", "projector",
                       ///< "repeated"
  std::string device;  ///< camera or projector; empty: all of them, or it cannot be told
  double before = 0;
  double after = 0;
  std::string text;  ///< in plain words
};

/// A single frame that differs from those around it.
struct OddFrame {
  std::size_t row = 0;
  std::string text;
};

struct WatchReport {
  std::vector<SequenceEvent> events;  ///< by frame; at last cameras that hung
  std::vector<OddFrame> odd;
};

/// Watches every camera's and projector's figures over the frames that are done (changes.h). A
/// camera that was bumped makes the crossings that it sees miss each other; a projector those of
/// its lines in all cameras. A camera that gives one picture again and again hangs: `after` counts
/// the repetitions.
[[nodiscard]] WatchReport watch_sequence(std::span<const FrameRow> rows,
                                         const SequenceDevices& devices);

}  // namespace pencilscan
