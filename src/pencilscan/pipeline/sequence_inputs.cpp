#include "pencilscan/pipeline/sequence_inputs.h"

#include <algorithm>
#include <exception>

#include "pencilscan/core/counted_progress.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/fields.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/hash.h"
#include "pencilscan/pipeline/repeated_pictures.h"
#include "pencilscan/pipeline/surface_chain.h"

namespace pencilscan {

namespace fs = std::filesystem;

namespace {

/// The options in words that tell most of them apart, and a hash of all of their values.
std::string options_text(const SequenceOptions& options) {
  const OutputOptions& output = options.output;
  const std::string_view method = solution_method(output.frame.points.method).name;
  return "method=" + std::string(method) + (output.frame.meshes ? "" : " mesh=no") +
         (output.frame.shape.depth.enabled ? "" : " depth=no") +
         (output.refine_rig ? " refine-rig=yes" : "") + (output.tracks ? "" : " independent=yes") +
         (options.plain_frames.empty() ? "" : " plain=yes") +
         " all=" + hex(hash_bytes(fields_text(output)));
}

}  // namespace

std::vector<std::size_t> refinement_frames(std::size_t frames) {
  constexpr std::size_t kMaxFrames = 24;  // more add little but time
  std::vector<std::size_t> picked;
  const std::size_t count = std::min(frames, kMaxFrames);
  for (std::size_t i = 0; i < count; ++i) picked.push_back(i * frames / count);
  return picked;
}

RunInputs describe_inputs(const fs::path& rig_path, const FrameSource& frames,
                          const SequenceOptions& options) {
  RunInputs inputs;
  inputs.program = options.program;
  inputs.rig = hex(hash_bytes(read_file(rig_path)));
  inputs.options = options_text(options);
  inputs.frames = frames.names();
  if (!options.output.refine_rig) return inputs;
  std::string hashes;
  for (const std::size_t i : refinement_frames(frames.size())) hashes += hex(frames.hash(i));
  inputs.refined_from = hex(hash_bytes(hashes));
  return inputs;
}

bool tracks(const SequenceOptions& options) {
  const OutputOptions& output = options.output;
  return output.tracks && output.frame.meshes && output.frame.shape.depth.enabled;
}

PictureHashes hashes_of(const FrameSource& frames, std::size_t frame) {
  PictureHashes hashes{frames.picture_hashes(frame), {}};
  hashes.all = hex(frames.hash(frame, hashes.of_cameras));
  return hashes;
}

std::vector<PictureHashes> picture_hashes(const FrameSource& frames,
                                          const std::vector<std::size_t>& own,
                                          const SequenceOptions& options) {
  std::vector<char> is_asked(frames.size(), 0);
  for (const std::size_t i : own) {
    const std::size_t first = tracks(options) ? first_of_chain(i) : i;
    for (std::size_t k = first; k <= i; ++k) is_asked[k] = 1;
  }
  std::vector<PictureHashes> hashes(frames.size());
  parallel_for(frames.size(), [&](std::size_t i) {
    if (is_asked[i] != 0) hashes[i] = hashes_of(frames, i);
  });
  return hashes;
}

std::vector<std::string> frame_keys(const std::vector<PictureHashes>& images,
                                    const SequenceOptions& options) {
  std::vector<std::string> keys;
  for (const PictureHashes& of_frame : images) keys.push_back(of_frame.all);
  return tracks(options) ? chain_keys(keys) : keys;
}

std::vector<std::string> repetitions(const Rig& rig, const FrameSource& frames,
                                     const std::vector<std::size_t>& own,
                                     const std::vector<PictureHashes>& images) {
  std::vector<std::vector<std::uint64_t>> of_frames(frames.size());
  for (const std::size_t i : own) of_frames[i] = images[i].of_cameras;
  std::vector<std::string> warnings;
  for (const RepeatedPicture& r : repeated_pictures(of_frames))
    warnings.push_back(
        describe_repeated(rig.cameras[r.camera].name, frames.name(r.first), frames.name(r.last)));
  return warnings;
}

std::optional<std::string> strangers_warning(const FrameSource& frames) {
  if (frames.strangers().empty()) return std::nullopt;
  std::string names;
  for (const std::string& name : frames.strangers()) add_name(names, name);
  return "the frames hold pictures that are named like no camera of the rig, and nobody looks at "
         "them: " +
         names;
}

std::optional<std::string> open_recording_warning(const FrameSource& frames) {
  if (frames.is_closed()) return std::nullopt;
  return "the recording was cut off or goes on: the sequence ends with frame " +
         frames.names().back() + ", the last one that is there now";
}

namespace {

void refuse_output(const fs::path& out, const std::string& rule, const SequenceOptions& options) {
  if (!options.overwrite)
    throw InputError("--out", "", out.string(), rule + " (or give --overwrite)");
}

}  // namespace

bool refuse_other_settings(const fs::path& out, const RunInputs& inputs,
                           const SequenceOptions& options) {
  if (is_new_run(out)) return true;
  if (!fs::is_directory(out)) throw InputError("--out", "", out.string(), "must be a folder");
  if (!has_run_inputs(out)) {
    refuse_output(out, "must be new, empty or the output of the same inputs", options);
    return false;
  }
  const RunInputs earlier = read_run_inputs(out);
  if (earlier.settings() == inputs.settings()) return true;
  RunInputs of_other_frames = earlier;
  of_other_frames.refined_from = inputs.refined_from;
  refuse_output(
      out,
      of_other_frames.settings() == inputs.settings()
          ? "holds a rig refined from other frames"
          : "holds the output of another rig, other options or another build of the program",
      options);
  return false;
}

std::vector<char> resumable(const fs::path& out, const RunInputs& inputs,
                            const std::vector<std::size_t>& own,
                            const std::vector<std::string>& keys, const SequenceOptions& options) {
  std::vector<char> done(own.size(), 0);
  if (!refuse_other_settings(out, inputs, options) || is_new_run(out)) return done;
  for (std::size_t i = 0; i < own.size(); ++i) {
    const std::string& name = inputs.frames[own[i]];
    const FrameState state = frame_status(out, name, inputs.settings(), keys[own[i]]).state;
    if (state == FrameState::kOther)
      refuse_output(out, "holds the output of other images in frame " + name, options);
    done[i] = state == FrameState::kDone ? 1 : 0;
  }
  return done;
}

void check_any_frame(const Rig& rig, const FrameSource& frames, const Progress& progress) {
  std::exception_ptr first;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    try {
      frames.check(rig, i);
      return;
    } catch (const InputError&) {
      if (!first) first = std::current_exception();
    }
    if (i + 1 < frames.size()) tell_steps(progress, "checking: frame", i + 1, frames.size());
  }
  if (first) std::rethrow_exception(first);
}

}  // namespace pencilscan
