#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace pencilscan {

/// Frames of a sequence come in chunks of so many, which start anew: what one frame may take over
/// from the one before it ends at their borders. Shards share out chunks, so that the number of
/// shards changes no byte. Two seconds at 25 frames/s: minutes to hours of work for a machine, and
/// a minute of capture is 30 chunks.
constexpr std::size_t kChunkFrames = 50;

/// Which of `shards` does a frame.
[[nodiscard]] constexpr std::size_t shard_of(std::size_t frame, std::size_t shards) {
  return frame / kChunkFrames % shards;
}

/// The part of a sequence that one of several programs does: every count-th chunk.
struct Shard {
  std::size_t index = 0;  ///< < count
  std::size_t count = 1;  ///< >= 1

  [[nodiscard]] bool holds(std::size_t frame) const { return shard_of(frame, count) == index; }
  /// Its frames of a sequence of `frames`, in order.
  [[nodiscard]] std::vector<std::size_t> frames_of(std::size_t frames) const;
};

/// What a sequence of so many frames can be shared out to at most; >= 1.
[[nodiscard]] std::size_t chunk_count(std::size_t frames);

/// The value of an environment variable, or nothing.
using Environment = std::function<std::optional<std::string>(const std::string& name)>;
[[nodiscard]] Environment process_environment();

/// "i/n" with i from 0, or "auto": the place in the array of jobs that Slurm, PBS, Grid Engine,
/// Kubernetes' indexed jobs, AWS Batch or OpenMPI gave this program. InputError for anything else,
/// and for auto where no scheduler says it.
[[nodiscard]] Shard shard_from_text(const std::string& text, const Environment& environment);

}  // namespace pencilscan
