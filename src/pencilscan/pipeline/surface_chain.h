#pragma once

#include <cstddef>
#include <exception>
#include <filesystem>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "pencilscan/core/error.h"
#include "pencilscan/pipeline/frame.h"

namespace pencilscan {

/// One frame of a sequence to be made.
struct ChainStep {
  std::size_t frame = 0;   ///< of the sequence
  bool is_written = true;  ///< false: only its surface is needed, by the next one
  bool follows = false;    ///< the step before hands its surface on to this one
  std::shared_ptr<const TrackedSurface> first;  ///< where it does not: what comes before, or null
};

/// The frame before could not be made this time, so this one cannot be, either.
struct ChainBroken : StageError {
  using StageError::StageError;
};

/// The first frame whose pictures decide the result of a frame: that of its chunk's run-in.
[[nodiscard]] std::size_t first_of_chain(std::size_t frame);

/// For every frame a hash of all that decide its result; `hashes`: of each frame's own pictures,
/// empty where nobody asks.
[[nodiscard]] std::vector<std::string> chain_keys(const std::vector<std::string>& hashes);

/// Frames of a sequence of which each is steadied by the surface of the one before. Chunks
/// (shard.h) start anew, some frames before their first (kMemoryMoments). Surfaces are
/// handed on between the threads that make frames, and lie in files, too, as long as a program that
/// is killed would need them to go on where it was.
class SurfaceChain {
 public:
  /// `names` and `keys`: of all frames; `own`: those of this program, rising; `there`: 1 for each
  /// of them that is there already.
  SurfaceChain(std::filesystem::path out, std::vector<std::string> names,
               std::vector<std::string> keys, const std::vector<std::size_t>& own,
               const std::vector<char>& there);

  [[nodiscard]] const std::vector<ChainStep>& steps() const { return steps_; }
  /// `links` with the surface that the step starts from, and handing on what it makes.
  [[nodiscard]] FrameLinks linked(FrameLinks links, std::size_t step);
  /// The step is over. One that handed nothing on hands on what it got; one that is `broken` makes
  /// those that follow throw ChainBroken.
  void end(std::size_t step, bool broken);

 private:
  using Surface = std::shared_ptr<const TrackedSurface>;
  void add_chunk(const std::vector<std::size_t>& frames, const std::vector<char>& there);
  [[nodiscard]] Surface before(std::size_t step) const;
  void hand_on(std::size_t step, Surface surface);
  void cut(std::size_t step, std::exception_ptr why);
  [[nodiscard]] std::filesystem::path file_of(std::size_t frame) const;
  void forget_step(std::size_t step) const;
  void forget(std::size_t frame) const;
  [[nodiscard]] bool is_followed(std::size_t step) const;

  std::filesystem::path out_;
  std::vector<std::string> names_;
  std::vector<std::string> keys_;
  std::vector<ChainStep> steps_;
  std::vector<std::promise<Surface>> promises_;
  std::vector<std::shared_future<Surface>> surfaces_;
  std::vector<char> is_handed_on_;
};

}  // namespace pencilscan
