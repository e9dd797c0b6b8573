#include "pencilscan/pipeline/sequence.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <nlohmann/json.hpp>
#include <utility>

#include "pencilscan/core/counted_progress.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/fields.h"
#include "pencilscan/core/memory.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/core/stopwatch.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/hash.h"
#include "pencilscan/io/mesh_file.h"
#include "pencilscan/labeling/point_file.h"
#include "pencilscan/pipeline/curve_output.h"
#include "pencilscan/pipeline/depth_output.h"
#include "pencilscan/pipeline/frame_output.h"
#include "pencilscan/pipeline/frame_source.h"
#include "pencilscan/pipeline/repeated_pictures.h"
#include "pencilscan/pipeline/rig_refinement.h"
#include "pencilscan/pipeline/run_folder.h"
#include "pencilscan/pipeline/surface_chain.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr const char* kDevicesFile = "devices.json";
constexpr const char* kRigFile = "rig.json";
constexpr const char* kRefinementFile = "refinement.json";

/// The frames that a rig is refined from: evenly picked.
std::vector<std::size_t> refinement_frames(std::size_t frames) {
  constexpr std::size_t kMaxFrames = 24;  // more add little but time
  std::vector<std::size_t> picked;
  const std::size_t count = std::min(frames, kMaxFrames);
  for (std::size_t i = 0; i < count; ++i) picked.push_back(i * frames / count);
  return picked;
}

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

/// What decides the output: the program, rig bytes, options, the frames that refine the rig.
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

/// What tells whether a frame's pictures are the same.
struct PictureHashes {
  std::vector<std::uint64_t> of_cameras;  ///< 0: no picture
  std::string all;
};

bool tracks(const SequenceOptions& options) {
  const OutputOptions& output = options.output;
  return output.tracks && output.frame.meshes && output.frame.shape.depth.enabled;
}

PictureHashes hashes_of(const FrameSource& frames, std::size_t frame) {
  PictureHashes hashes{frames.picture_hashes(frame), {}};
  hashes.all = hex(frames.hash(frame, hashes.of_cameras));
  return hashes;
}

/// Of the frames `own` and, where frames start from those before, of these; of the others nothing.
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

/// What each frame's result depends on.
std::vector<std::string> frame_keys(const std::vector<PictureHashes>& images,
                                    const SequenceOptions& options) {
  std::vector<std::string> keys;
  for (const PictureHashes& of_frame : images) keys.push_back(of_frame.all);
  return tracks(options) ? chain_keys(keys) : keys;
}

/// Warns of cameras that hung; of a shard's frames, within its chunks.
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

/// Decides which of the frames `own` are there already; refuses the output of other inputs.
std::vector<char> resumable(const fs::path& out, const RunInputs& inputs,
                            const std::vector<std::size_t>& own,
                            const std::vector<std::string>& keys, const SequenceOptions& options) {
  std::vector<char> done(own.size(), 0);
  if (is_new_run(out)) return done;
  const auto refuse = [&](const std::string& what) {
    if (!options.overwrite)
      throw InputError("--out", "", out.string(), what + " (or give --overwrite)");
  };
  if (!fs::is_directory(out)) throw InputError("--out", "", out.string(), "must be a folder");
  if (!has_run_inputs(out)) {
    refuse("must be new, empty or the output of the same inputs");
    return done;
  }
  const RunInputs earlier = read_run_inputs(out);
  if (earlier.settings() != inputs.settings()) {
    RunInputs of_other_frames = earlier;
    of_other_frames.refined_from = inputs.refined_from;
    refuse(of_other_frames.settings() == inputs.settings()
               ? "holds a rig refined from other frames"
               : "holds the output of another rig, other options or another build of the program");
    return done;
  }
  for (std::size_t i = 0; i < own.size(); ++i) {
    const std::string& name = inputs.frames[own[i]];
    const FrameState state = frame_status(out, name, inputs.settings(), keys[own[i]]).state;
    if (state == FrameState::kOther) refuse("holds the output of other images in frame " + name);
    done[i] = state == FrameState::kDone ? 1 : 0;
  }
  return done;
}

void check_images(const Rig& rig, const FrameSource& frames, const Progress& progress) {
  // In chunks, so that only a few decoded frames are in memory.
  const auto chunk = static_cast<std::size_t>(thread_count());
  for (std::size_t first = 0; first < frames.size(); first += chunk) {
    const std::size_t count = std::min(chunk, frames.size() - first);
    parallel_for(count, [&](std::size_t i) {
      const Frame frame = frames.read(rig, first + i);
      static_cast<void>(frame);
    });
    tell_steps(progress, "checking: frame", first + count, frames.size());
  }
}

/// A frame that is there, or of the chunk before: its surface goes on, nothing is written.
void pass_frame(const Rig& rig, const FrameSource& frames, std::size_t index,
                const OutputOptions& options, const FrameLinks& links) {
  static_cast<void>(reconstruct_frame(rig, frames.read(rig, index), options.frame, links));
}

void write_frame(const Rig& rig, const FrameSource& frames, std::size_t index,
                 const PictureHashes& images, const fs::path& folder, const OutputOptions& options,
                 const FrameLinks& links, FrameOutcome& outcome) {
  const Stopwatch total;
  const Frame frame = frames.read(rig, index);
  const double reading = total.seconds();
  auto [points, shape, times] = reconstruct_frame(rig, frame, options.frame, links);
  const SurfaceResult& surface = shape.surface;
  write_points(folder / "points.ply", points.points);
  write_curves(folder / "curves.ply", describe_curves(rig, points));
  if (options.frame.meshes) {
    write_mesh(folder / "mesh.ply", surface.mesh);
    write_mesh(folder / "mesh_measured.ply", surface.measured);
    for (const std::string& format : options.mesh_formats)
      export_mesh(folder / ("mesh." + format), surface.mesh);
  }
  if (options.frame.meshes && options.depth_maps) write_depth_maps(folder, rig, shape);
  if (options.pictures) {
    const Stopwatch picture_watch;
    write_camera_pictures(folder / "pictures", rig, frame);
    write_frame_pictures(folder / "pictures", rig, frame, points, shape);
    if (options.frame.meshes) write_hole_pictures(folder / "pictures", rig, shape);
    times.push_back({"pictures", picture_watch.seconds()});
  }
  ordered_json timing;
  timing["threads"] = thread_count();
  timing["seconds"] = {{"reading", reading}};
  for (const StageTime& t : times) timing["seconds"][t.stage] = t.seconds;
  timing["seconds"]["total"] = total.seconds();
  write_json(folder / "timing.json", timing);
  ordered_json report = frame_report(rig, frame, points, shape);
  for (std::size_t c = 0; c < images.of_cameras.size(); ++c)
    if (images.of_cameras[c] != 0) report["cameras"][c]["picture"] = hex(images.of_cameras[c]);
  write_json(folder / "report.json", report);
  outcome.points = points.points.size();
  outcome.warnings = report["warnings"].get<std::vector<std::string>>();
  outcome.seconds = total.seconds();
  if (hashes_of(frames, index).all != images.all)
    throw StageError("its pictures changed while it was made; run the same command again");
}

bool is_output_file(const fs::path& rig_path, const fs::path& file) {
  return fs::exists(file) && fs::equivalent(rig_path, file);
}

bool is_output_rig(const fs::path& rig_path, const fs::path& out) {
  return is_output_file(rig_path, out / kRigFile);
}

/// Removes what an earlier run refined, and nothing that anybody else wrote or that is read now.
void remove_refined_rig(const fs::path& out, const fs::path& rig_path) {
  if (!fs::exists(out / kRefinementFile) || is_output_rig(rig_path, out)) return;
  fs::remove(out / kRigFile);
  fs::remove(out / kRefinementFile);
}

/// The rig to reconstruct with: refined from the frames, or what an earlier run refined.
Rig refined_rig(const Rig& rig, const FrameSource& frames, const fs::path& out,
                const SequenceOptions& options, const Progress& progress,
                RefinementOutcome& outcome) {
  if (fs::exists(out / kRigFile) && fs::exists(out / kRefinementFile)) {
    outcome = refinement_outcome(ordered_json(read_json(out / kRefinementFile)));
    outcome.resumed = true;
    return read_rig(out / kRigFile);
  }
  const std::vector<std::size_t> picked = refinement_frames(frames.size());
  std::vector<FrameCurves> curves;
  std::vector<std::string> names;
  for (const std::size_t i : picked) {
    tell_steps(progress, "lines for the rig: frame", names.size(), picked.size());
    PointOptions joint = options.output.frame.points;
    joint.method = JointOptions{};
    PointResult detected = detect_frame(rig, frames.read(rig, i), joint);
    curves.push_back({std::move(detected.families), std::move(detected.graphs)});
    names.push_back(frames.name(i));
  }
  if (progress) progress("refining the rig", 0);
  RigRefinementOptions refinement_options;
  refinement_options.points = options.output.frame.points;
  const RigRefinement refinement = refine_rig_on_frames(rig, curves, refinement_options);
  const ordered_json report = refinement_report(refinement, names);
  write_json(out / kRefinementFile, report);
  write_rig(refinement.rig, out / kRigFile);  // last: its presence means that refinement is done
  outcome = refinement_outcome(report);
  return refinement.rig;
}

/// What all frames of a run have in common.
struct Run {
  const Rig& rig;
  const FrameSource& frames;
  const fs::path& out;
  std::string settings;
  const std::vector<PictureHashes>& images;
  const std::vector<std::string>& keys;
};

/// A frame into its folder, or why not; one that is not written just passes.
std::optional<FrameFailure> make_frame(const Run& run, std::size_t index, bool is_written,
                                       const OutputOptions& options, const FrameLinks& links,
                                       FrameOutcome& outcome) {
  try {
    if (!is_written) {
      pass_frame(run.rig, run.frames, index, options, links);
      return std::nullopt;
    }
    FrameFolder folder(run.out, outcome.name, run.settings, run.keys[index]);
    write_frame(run.rig, run.frames, index, run.images[index], folder.path(), options, links,
                outcome);
    folder.publish();
    outcome.done = true;
    return std::nullopt;
  } catch (const InputError& error) {
    return FrameFailure{error.what(), false};
  } catch (const NothingFound& error) {
    return FrameFailure{error.what(), false};
  } catch (const std::exception& error) {
    return FrameFailure{in_plain_words(error), true};
  }
}

/// A failure into the frame's folder.
void note_failure(const Run& run, std::size_t index, const FrameFailure& failure,
                  FrameOutcome& outcome) {
  outcome.failure = failure.reason;
  try {
    write_failure(run.out, outcome.name, run.settings, run.keys[index], failure);
  } catch (const std::exception&) {
    // What keeps the reason from being written is the reason.
  }
}

/// Tells how far the frames are, from any of the threads that make them.
class FrameProgress {
 public:
  FrameProgress(const Progress& progress, std::size_t frames)
      : progress_(progress), frames_(frames) {}

  /// Links of the i-th frame, whose stages are told as part of it.
  FrameLinks links(std::size_t i) {
    FrameLinks telling;
    if (!progress_) return telling;
    const std::string frame = "frame " + std::to_string(i + 1) + " of " + std::to_string(frames_);
    telling.progress = [this, frame](std::string_view stage, double) {
      const std::lock_guard lock(mutex_);
      progress_(frame + ": " + std::string(stage),
                static_cast<double>(done_) / static_cast<double>(frames_));
    };
    return telling;
  }

  void done(const std::string& name) {
    const std::lock_guard lock(mutex_);
    tell_steps(progress_, "frame " + name + ",", ++done_, frames_);
  }

 private:
  const Progress& progress_;
  std::size_t frames_;
  std::mutex mutex_;
  std::size_t done_ = 0;
};

/// All frames that are not there, several at once.
std::vector<FrameOutcome> make_frames(const Run& run, const std::vector<std::size_t>& own,
                                      const std::vector<char>& there,
                                      const SequenceOptions& options, const Progress& progress) {
  std::vector<FrameOutcome> outcomes(own.size());
  std::vector<std::size_t> outcome_of(run.frames.size(), own.size());
  std::vector<std::size_t> missing;
  FrameProgress frame_progress(progress, own.size());
  for (std::size_t i = 0; i < own.size(); ++i) {
    outcomes[i].name = run.frames.name(own[i]);
    outcomes[i].done = outcomes[i].resumed = there[i] != 0;
    outcome_of[own[i]] = i;
    if (there[i] != 0) frame_progress.done(outcomes[i].name);
    if (there[i] == 0) missing.push_back(own[i]);
  }
  const auto make = [&](std::size_t index, bool is_written, const FrameLinks& links) {
    FrameOutcome passed;
    FrameOutcome& outcome = is_written ? outcomes[outcome_of[index]] : passed;
    const auto failure = make_frame(run, index, is_written, options.output, links, outcome);
    if (failure && is_written) note_failure(run, index, *failure, outcome);
    if (is_written) frame_progress.done(outcome.name);
    return failure && failure->is_passing;
  };
  if (!tracks(options)) {
    run_at_once(missing.size(), frames_at_once(run.rig), [&](std::size_t i) {
      make(missing[i], true, frame_progress.links(outcome_of[missing[i]]));
    });
    return outcomes;
  }
  SurfaceChain chain(run.out, run.frames.names(), run.keys, own, there);
  run_at_once(chain.steps().size(), frames_at_once(run.rig), [&](std::size_t k) {
    const ChainStep& step = chain.steps()[k];
    const FrameLinks links = frame_progress.links(std::min(outcome_of[step.frame], own.size() - 1));
    chain.end(k, make(step.frame, step.is_written, chain.linked(links, k)));
  });
  return outcomes;
}

}  // namespace

std::size_t frames_at_once(const Rig& rig) {
  // .57 GB for six pictures of 1280 x 960 (docs/performance.md), and a third more.
  constexpr double kBytesPerPixel = 100;
  double pixels = 0;
  for (const Camera& camera : rig.cameras)
    pixels += static_cast<double>(camera.width) * camera.height;
  const double most = available_memory() / (kBytesPerPixel * std::max(1.0, pixels));
  const double useful = (thread_count() + 2) / 2;  // one for one thread, two for two
  return static_cast<std::size_t>(std::max(1.0, std::min(useful, std::floor(most))));
}

SequenceOutcome reconstruct_sequence(const fs::path& rig_path, const fs::path& frames_path,
                                     const fs::path& out, const SequenceOptions& options,
                                     const Progress& progress) {
  Rig rig = read_rig(rig_path);
  FrameSource frames = FrameSource::open(rig, frames_path);
  if (!options.plain_frames.empty()) frames.add_plain(rig, options.plain_frames);
  if (options.output.refine_rig && is_output_rig(rig_path, out)) {
    throw InputError("--rig", "", rig_path.string(),
                     "must not be the rig.json in --out, where the refined rig is written");
  }
  const std::string_view rule = broken_rule(rig, options.output.frame.points.method);
  if (!rule.empty()) throw InputError(rig_path.string(), "projectors", "", std::string(rule));
  // One of several shards leaves the other frames to the others, and a broken one is a failed one.
  if (!options.shard) check_images(rig, frames, progress);
  const std::vector<std::size_t> own = options.shard.value_or(Shard{}).frames_of(frames.size());
  const RunInputs inputs = describe_inputs(rig_path, frames, options);
  const std::vector<PictureHashes> images = picture_hashes(frames, own, options);
  const std::vector<std::string> keys = frame_keys(images, options);
  const std::vector<char> there = resumable(out, inputs, own, keys, options);

  // From here on the output may change. What is to be made anew goes first.
  for (std::size_t i = 0; i < own.size(); ++i) {
    if (there[i] == 0) fs::remove_all(out / frames.name(own[i]));
  }
  remove_abandoned(out);
  if (!has_run_inputs(out) || read_run_inputs(out).settings() != inputs.settings())
    remove_refined_rig(out, rig_path);
  write_run_inputs(out, inputs);

  SequenceOutcome result;
  result.warnings = repetitions(rig, frames, own, images);
  if (options.output.refine_rig)
    rig = refined_rig(rig, frames, out, options, progress, result.refinement.emplace());
  // The rig in use, so that the output can be looked at without its input.
  if (!is_output_file(rig_path, out / kDevicesFile)) write_rig(rig, out / kDevicesFile);
  const Run run{rig, frames, out, inputs.settings(), images, keys};
  result.frames = make_frames(run, own, there, options, progress);
  return result;
}

}  // namespace pencilscan
