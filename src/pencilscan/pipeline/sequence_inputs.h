#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "pencilscan/pipeline/frame_source.h"
#include "pencilscan/pipeline/run_folder.h"
#include "pencilscan/pipeline/sequence.h"

// What a sequence's output depends on, and what of it is there already.

namespace pencilscan {

/// The frames that a rig is refined from: evenly picked.
[[nodiscard]] std::vector<std::size_t> refinement_frames(std::size_t frames);

/// What decides the output: the program, rig bytes, options, the frames that refine the rig.
[[nodiscard]] RunInputs describe_inputs(const std::filesystem::path& rig_path,
                                        const FrameSource& frames, const SequenceOptions& options);

/// True where frames start from the surfaces of those before.
[[nodiscard]] bool tracks(const SequenceOptions& options);

/// What tells whether a frame's pictures are the same.
struct PictureHashes {
  std::vector<std::uint64_t> of_cameras;  ///< 0: no picture
  std::string all;
};
[[nodiscard]] PictureHashes hashes_of(const FrameSource& frames, std::size_t frame);

/// Of the frames `own` and, where frames start from those before, of these; of the others nothing.
[[nodiscard]] std::vector<PictureHashes> picture_hashes(const FrameSource& frames,
                                                        const std::vector<std::size_t>& own,
                                                        const SequenceOptions& options);

/// What each frame's result depends on.
[[nodiscard]] std::vector<std::string> frame_keys(const std::vector<PictureHashes>& images,
                                                  const SequenceOptions& options);

/// Warns of cameras that hung; of a shard's frames, within its chunks.
[[nodiscard]] std::vector<std::string> repetitions(const Rig& rig, const FrameSource& frames,
                                                   const std::vector<std::size_t>& own,
                                                   const std::vector<PictureHashes>& images);

/// InputError where `out` is there and not the output of these settings, unless it may be replaced.
/// True where it is new or theirs.
bool refuse_other_settings(const std::filesystem::path& out, const RunInputs& inputs,
                           const SequenceOptions& options);

/// Warns of pictures that belong to no camera of the rig.
[[nodiscard]] std::optional<std::string> strangers_warning(const FrameSource& frames);

/// Warns of a recording that was cut off or goes on.
[[nodiscard]] std::optional<std::string> open_recording_warning(const FrameSource& frames);

/// Decides which of the frames `own` are there already; refuses the output of other inputs
/// (InputError).
[[nodiscard]] std::vector<char> resumable(const std::filesystem::path& out, const RunInputs& inputs,
                                          const std::vector<std::size_t>& own,
                                          const std::vector<std::string>& keys,
                                          const SequenceOptions& options);

/// InputError, that of the first frame, where the pictures of none can be read.
void check_any_frame(const Rig& rig, const FrameSource& frames, const Progress& progress);

}  // namespace pencilscan
