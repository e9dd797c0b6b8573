#include "pencilscan/pipeline/sequence.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <nlohmann/json.hpp>
#include <utility>

#include "pencilscan/core/counted_progress.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/memory.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/core/stopwatch.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/hash.h"
#include "pencilscan/io/mesh_file.h"
#include "pencilscan/io/output_place.h"
#include "pencilscan/labeling/point_file.h"
#include "pencilscan/pipeline/curve_output.h"
#include "pencilscan/pipeline/depth_output.h"
#include "pencilscan/pipeline/frame_output.h"
#include "pencilscan/pipeline/frame_source.h"
#include "pencilscan/pipeline/rig_refinement.h"
#include "pencilscan/pipeline/run_folder.h"
#include "pencilscan/pipeline/sensor_frame.h"
#include "pencilscan/pipeline/sequence_inputs.h"
#include "pencilscan/pipeline/surface_chain.h"
#include "pencilscan/recording/frame_folders.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr const char* kDevicesFile = "devices.json";
constexpr const char* kRigFile = "rig.json";
constexpr const char* kRefinementFile = "refinement.json";

/// A frame that is there, or of the chunk before: its surface goes on, nothing is written.
void pass_frame(const Rig& rig, const FrameSource& frames, std::size_t index,
                const OutputOptions& options, FrameLinks links) {
  links.only_hands_on = true;
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
  write_points(folder / "points.ply", points.points, rig.unit_known);
  write_curves(folder / "curves.ply", describe_curves(rig, points));
  if (options.frame.meshes) {
    write_mesh(folder / "mesh.ply", surface.mesh, rig.unit_known);
    write_mesh(folder / "mesh_measured.ply", surface.measured, rig.unit_known);
    for (const std::string& format : options.mesh_formats)
      export_mesh(folder / ("mesh." + format), surface.mesh, rig.unit_known);
  }
  std::vector<std::string> of_depth_maps;
  if (options.frame.meshes && options.depth_maps)
    of_depth_maps = write_depth_maps(folder, rig, shape);
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
  for (std::string& warning : of_depth_maps) report["warnings"].push_back(std::move(warning));
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
    outcome = refinement_outcome(rig, ordered_json(read_json(out / kRefinementFile)));
    outcome.resumed = true;
    return read_rig(out / kRigFile);
  }
  const std::vector<std::size_t> picked = refinement_frames(frames.size());
  std::vector<FrameCurves> curves;
  std::vector<std::string> names;
  PointOptions joint = options.output.frame.points;
  joint.method = JointOptions{};
  for (std::size_t k = 0; k < picked.size(); ++k) {
    tell_steps(progress, "lines for the rig: frame", k, picked.size());
    try {
      PointResult detected = detect_stored_frame(rig, frames.read(rig, picked[k]), joint);
      curves.push_back({std::move(detected.families), std::move(detected.graphs)});
      names.push_back(frames.name(picked[k]));
    } catch (const InputError&) {
      // A broken frame tells nothing of the rig; it is a failed one by itself.
      if (names.empty() && k + 1 == picked.size()) throw;
    }
  }
  if (progress) progress("refining the rig", 0);
  RigRefinementOptions refinement_options;
  refinement_options.points = options.output.frame.points;
  const RigRefinement refinement = refine_rig_on_frames(rig, curves, refinement_options);
  const ordered_json report = refinement_report(refinement, names);
  write_json(out / kRefinementFile, report);
  write_rig(refinement.rig, out / kRigFile);  // last: its presence means that refinement is done
  outcome = refinement_outcome(rig, report);
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
  } catch (const PicturesAtFault& error) {
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
    return links("frame " + std::to_string(i + 1) + " of " + std::to_string(frames_));
  }

  /// Links of a frame of the chunk before, from which a surface comes.
  FrameLinks links_before(const std::string& name) {
    return links("frame " + name + " of the chunk before");
  }

  void done(const std::string& name) {
    const std::lock_guard lock(mutex_);
    tell_steps(progress_, "frame " + name + ",", ++done_, frames_);
  }

 private:
  FrameLinks links(const std::string& frame) {
    FrameLinks telling;
    if (!progress_) return telling;
    telling.progress = [this, frame](std::string_view stage, double) {
      const std::lock_guard lock(mutex_);
      progress_(frame + ": " + std::string(stage),
                static_cast<double>(done_) / static_cast<double>(frames_));
    };
    return telling;
  }

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
    const std::size_t own_index = outcome_of[step.frame];
    const FrameLinks links = own_index < own.size()
                                 ? frame_progress.links(own_index)
                                 : frame_progress.links_before(run.frames.name(step.frame));
    chain.end(k, make(step.frame, step.is_written, chain.linked(links, k)));
  });
  return outcomes;
}

struct SequenceInput {
  Rig rig;
  FrameSource frames;
};

/// InputError where rig, frames and options do not go together.
SequenceInput open_input(const fs::path& rig_path, const fs::path& frames_path, const fs::path& out,
                         const SequenceOptions& options) {
  Rig rig = read_rig(rig_path);
  require_patterns(rig, rig_path.string(), "there is nothing to see of this projector");
  FrameSource frames = FrameSource::open(rig, frames_path);
  if (!options.plain_frames.empty()) frames.add_plain(rig, options.plain_frames);
  refuse_as_output("--frames", frames_path, out);
  refuse_as_output("--plain-frames", options.plain_frames, out);
  if (options.output.refine_rig && is_output_rig(rig_path, out)) {
    throw InputError("--rig", "", rig_path.string(),
                     "must not be the rig.json in --out, where the refined rig is written");
  }
  const std::string_view rule = broken_rule(rig, options.output.frame.points.method);
  if (!rule.empty()) throw InputError(rig_path.string(), "projectors", "", std::string(rule));
  return {std::move(rig), std::move(frames)};
}

}  // namespace

std::size_t frames_at_once(const Rig& rig) {
  // .45 GB for six pictures of 1280 x 960 (docs/performance.md), two thirds more for cluttered
  // ones.
  constexpr double kBytesPerPixel = 100;
  double pixels = 0;
  for (const Camera& camera : rig.cameras)
    pixels += static_cast<double>(camera.width) * camera.height;
  const double most = available_memory() / (kBytesPerPixel * std::max(1.0, pixels));
  const double useful = (thread_count() + 2) / 2;  // one for one thread, two for two
  return static_cast<std::size_t>(std::max(1.0, std::min(useful, std::floor(most))));
}

FrameSource check_sequence(const fs::path& rig_path, const fs::path& frames, const fs::path& out,
                           const SequenceOptions& options) {
  SequenceInput input = open_input(rig_path, frames, out, options);
  refuse_other_settings(out, describe_inputs(rig_path, input.frames, options), options);
  return std::move(input.frames);
}

SequenceOutcome reconstruct_sequence(const fs::path& rig_path, const fs::path& frames_path,
                                     const fs::path& out, const SequenceOptions& options,
                                     const Progress& progress) {
  auto [rig, frames] = open_input(rig_path, frames_path, out, options);
  // A broken frame is a failed one. One of several shards leaves the others' frames to them.
  if (!options.shard) check_any_frame(rig, frames, progress);
  const std::vector<std::size_t> own = options.shard.value_or(Shard{}).frames_of(frames.size());
  const RunInputs inputs = describe_inputs(rig_path, frames, options);
  const std::vector<PictureHashes> images = picture_hashes(frames, own, options);
  const std::vector<std::string> keys = frame_keys(images, options);
  const std::vector<char> there = resumable(out, inputs, own, keys, options);

  for (std::size_t i = 0; i < own.size(); ++i) {
    if (there[i] == 0) check_replaceable(out, frames.name(own[i]));
  }

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
  if (auto warning = strangers_warning(frames)) result.warnings.push_back(std::move(*warning));
  if (auto warning = order_warning(frames.names())) result.warnings.push_back(std::move(*warning));
  if (auto warning = open_recording_warning(frames)) result.warnings.push_back(std::move(*warning));
  for (const std::string& warning : frames.left_out()) result.warnings.push_back(warning);
  if (auto warning = strays_warning(out, inputs.frames))
    result.warnings.push_back(std::move(*warning));
  if (options.output.refine_rig)
    rig = refined_rig(rig, frames, out, options, progress, result.refinement.emplace());
  // The rig in use, so that the output can be looked at without its input.
  if (!is_output_file(rig_path, out / kDevicesFile)) write_rig(rig, out / kDevicesFile);
  const Run run{rig, frames, out, inputs.settings(), images, keys};
  result.frames = make_frames(run, own, there, options, progress);
  return result;
}

}  // namespace pencilscan
