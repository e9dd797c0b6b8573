#pragma once

#include <span>
#include <string>
#include <vector>

#include "pencilscan/jobs/frame_rows.h"

namespace pencilscan {

/// Something that is so in some frames.
struct SequenceEvent {
  std::size_t first = 0;  ///< row of the first frame
  std::size_t last = 0;   ///< row of the last one
  bool lasts = false;     ///< to the end of the sequence
  std::string kind;       ///< "crossings", "labelled", "width", "height", "level", "projector",
                          ///< "light", "repeated", or the code of a finding
  std::string device;     ///< camera or projector; empty: all of them, or it cannot be told
  double before = kUnknownFigure;
  double after = kUnknownFigure;
  std::string text;  ///< in plain words
};

/// "from frame 000008", "in frames 000008 to 000010" or "in frame 000008".
[[nodiscard]] std::string when_text(const SequenceEvent& event, std::span<const FrameRow> rows);

/// A single frame that differs from those around it.
struct OddFrame {
  std::size_t row = 0;
  std::string text;
};

struct WatchReport {
  std::vector<SequenceEvent> events;  ///< by first frame
  std::vector<OddFrame> odd;
  /// Devices that most frames say too little of to see whether they were moved: fewer crossings
  /// than a median is taken of.
  std::vector<std::string> not_watched;
};

/// Watches every camera's and projector's figures over the frames that are done (changes.h). A
/// camera that was bumped makes the crossings that it sees miss each other; a projector those of
/// its lines in all cameras. A camera that gives one picture again and again hangs: `after` counts
/// the repetitions. What frames say themselves of a device, as that its picture was left out or is
/// missing, is an event too; what they say of no device is none where every frame says it.
[[nodiscard]] WatchReport watch_sequence(std::span<const FrameRow> rows,
                                         const SequenceDevices& devices);

}  // namespace pencilscan
