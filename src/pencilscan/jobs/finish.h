#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "pencilscan/jobs/watch.h"

namespace pencilscan {

/// A frame without a result.
struct Hole {
  std::size_t row = 0;
  std::string state;  ///< "missing", "failed" or "other"
  std::string reason;
  bool may_fill = true;  ///< running it again may help
};

struct SequenceSummary {
  std::vector<FrameRow> rows;  ///< one per frame of the sequence
  SequenceDevices devices;
  std::vector<Hole> holes;
  WatchReport watch;

  [[nodiscard]] std::size_t done() const { return rows.size() - holes.size(); }
  /// Frames of which some figure is odd.
  [[nodiscard]] std::size_t odd_frames() const;
};

/// What the output folder of a sequence holds and lacks. InputError when it is none.
[[nodiscard]] SequenceSummary summarize_sequence(const std::filesystem::path& out);

/// `out`/sequence.csv: one row a frame; `out`/sequence.json: the same with holes and events.
void write_summary(const std::filesystem::path& out, const SequenceSummary& summary);

/// Says of which frames the pictures are at fault, so that running them again as they were helps
/// nothing, and what to do where they were repaired since.
[[nodiscard]] std::optional<std::string> not_run_again(const SequenceSummary& summary);

/// The tasks of `tasks` (task i does shard i/tasks) that hold a hole which may be filled.
[[nodiscard]] std::vector<std::size_t> tasks_with_holes(const SequenceSummary& summary,
                                                        std::size_t tasks);

}  // namespace pencilscan
