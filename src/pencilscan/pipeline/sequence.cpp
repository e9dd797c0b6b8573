#include "pencilscan/pipeline/sequence.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "pencilscan/core/error.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/core/stopwatch.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/mesh_file.h"
#include "pencilscan/pipeline/curve_output.h"
#include "pencilscan/pipeline/depth_output.h"
#include "pencilscan/pipeline/frame_files.h"
#include "pencilscan/pipeline/frame_output.h"
#include "pencilscan/pipeline/rig_refinement.h"
#include "pencilscan/solution/single_projector.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr const char* kInputsFile = "inputs.json";
constexpr const char* kDevicesFile = "devices.json";
constexpr const char* kRigFile = "rig.json";
constexpr const char* kRefinementFile = "refinement.json";

std::string hex(std::uint64_t value) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string text(16, '0');
  for (std::size_t i = 16; i-- > 0; value >>= 4U) text[i] = kDigits[value & 15U];
  return text;
}

/// What decides the output: the program, rig bytes, options, image bytes of every frame.
ordered_json describe_inputs(const fs::path& rig_path, const std::vector<FrameFiles>& frames,
                             const std::string& options) {
  std::vector<std::uint64_t> hashes(frames.size());
  parallel_for(frames.size(), [&](std::size_t i) { hashes[i] = frame_hash(frames[i]); });
  ordered_json inputs;
  inputs["program"] = hex(hash_bytes(read_file("/proc/self/exe")));
  inputs["rig"] = hex(hash_bytes(read_file(rig_path)));
  inputs["options"] = options;
  inputs["frames"] = ordered_json::object();
  for (std::size_t i = 0; i < frames.size(); ++i) inputs["frames"][frames[i].name] = hex(hashes[i]);
  return inputs;
}

/// True when `earlier` says that a frame was made from the same inputs.
bool same_frame(const nlohmann::json& earlier, const ordered_json& now, const std::string& name) {
  if (!earlier.contains("frames") || !earlier["frames"].contains(name)) return false;
  return earlier["frames"][name] == now["frames"][name].get<std::string>();
}

bool same_settings(const nlohmann::json& earlier, const ordered_json& now) {
  for (const char* key : {"program", "rig", "options"}) {
    if (!earlier.contains(key) || earlier[key] != now[key].get<std::string>()) return false;
  }
  return true;
}

/// Decides which frames are there already; refuses the output of other inputs. A refined rig is of
/// all frames together: with another frame, none is there.
std::vector<char> resumable(const fs::path& out, const std::vector<FrameFiles>& frames,
                            const ordered_json& inputs, const SequenceOptions& options) {
  std::vector<char> done(frames.size(), 0);
  if (!fs::exists(out) || (fs::is_directory(out) && fs::is_empty(out))) return done;
  const auto refuse = [&](const std::string& what) {
    if (!options.overwrite)
      throw InputError("--out", "", out.string(), what + " (or give --overwrite)");
  };
  if (!fs::is_directory(out)) throw InputError("--out", "", out.string(), "must be a folder");
  if (!fs::exists(out / kInputsFile)) {
    refuse("must be new, empty or the output of the same inputs");
    return done;
  }
  const nlohmann::json earlier = read_json(out / kInputsFile);
  if (!same_settings(earlier, inputs)) {
    refuse("holds the output of another rig, other options or another build of the program");
    return done;
  }
  if (options.refine_rig &&
      earlier.value("frames", nlohmann::json()) != nlohmann::json(inputs["frames"])) {
    refuse("holds a rig refined from other frames");
    return done;
  }
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const bool there = fs::exists(out / frames[i].name / "report.json");
    if (there && !same_frame(earlier, inputs, frames[i].name)) {
      refuse("holds the output of other images in frame " + frames[i].name);
      continue;
    }
    done[i] = there ? 1 : 0;
  }
  return done;
}

void check_images(const Rig& rig, const std::vector<FrameFiles>& frames, const Progress& progress) {
  // In chunks, so that only a few decoded frames are in memory.
  const auto chunk = static_cast<std::size_t>(thread_count());
  for (std::size_t first = 0; first < frames.size(); first += chunk) {
    const std::size_t count = std::min(chunk, frames.size() - first);
    parallel_for(count, [&](std::size_t i) {
      const Frame frame = read_frame(rig, frames[first + i]);
      static_cast<void>(frame);
    });
    if (progress) {
      progress("checking images",
               static_cast<double>(first + count) / static_cast<double>(frames.size()));
    }
  }
}

void reconstruct_frame(const Rig& rig, const FrameFiles& files, const fs::path& folder,
                       const SequenceOptions& options, FrameOutcome& outcome) {
  const Stopwatch total;
  const Frame frame = read_frame(rig, files);
  const double reading = total.seconds();
  PointResult points = measure_points(rig, frame, options.points);
  if (points.points.empty()) {
    throw StageError("no curve could be given its projector line");
  }
  ShapeResult shape =
      options.meshes ? measure_shape(rig, frame, points, options.shape) : ShapeResult{};
  points.times.insert(points.times.end(), shape.times.begin(), shape.times.end());
  look_again(rig, options.points, points, shape);
  const SurfaceResult& surface = shape.surface;
  write_points(folder / "points.ply", points.points);
  write_curves(folder / "curves.ply", describe_curves(points));
  if (options.meshes) {
    write_mesh(folder / "mesh.ply", surface.mesh);
    write_mesh(folder / "mesh_measured.ply", surface.measured);
    for (const std::string& format : options.mesh_formats)
      export_mesh(folder / ("mesh." + format), surface.mesh);
  }
  if (options.meshes && options.depth_maps) write_depth_maps(folder, rig, shape);
  if (options.pictures) {
    const Stopwatch picture_watch;
    write_camera_pictures(folder / "pictures", rig, frame);
    write_frame_pictures(folder / "pictures", rig, frame, points, shape);
    if (options.meshes) write_hole_pictures(folder / "pictures", rig, shape);
    points.times.push_back({"pictures", picture_watch.seconds()});
  }
  ordered_json timing;
  timing["threads"] = thread_count();
  timing["seconds"] = {{"reading", reading}};
  for (const StageTime& t : points.times) timing["seconds"][t.stage] = t.seconds;
  timing["seconds"]["total"] = total.seconds();
  write_json(folder / "timing.json", timing);
  const ordered_json report = frame_report(rig, frame, points, shape);
  write_json(folder / "report.json", report);  // last: its presence means that the frame is done
  outcome.points = points.points.size();
  outcome.warnings = report["warnings"].get<std::vector<std::string>>();
  outcome.seconds = total.seconds();
  outcome.done = true;
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
Rig refined_rig(const Rig& rig, const std::vector<FrameFiles>& frames, const fs::path& out,
                const SequenceOptions& options, const Progress& progress,
                RefinementOutcome& outcome) {
  if (fs::exists(out / kRigFile) && fs::exists(out / kRefinementFile)) {
    outcome = refinement_outcome(ordered_json(read_json(out / kRefinementFile)));
    outcome.resumed = true;
    return read_rig(out / kRigFile);
  }
  constexpr std::size_t kMaxFrames = 24;  // more add little but time
  const std::size_t count = std::min(frames.size(), kMaxFrames);
  std::vector<FrameCurves> curves;
  std::vector<std::string> names;
  for (std::size_t i = 0; i < count; ++i) {
    const FrameFiles& files = frames[i * frames.size() / count];
    if (progress)
      progress("lines for the rig", static_cast<double>(i) / static_cast<double>(count));
    PointOptions joint = options.points;
    joint.solution.method = Method::kJoint;
    PointResult detected = detect_frame(rig, read_frame(rig, files), joint);
    curves.push_back({std::move(detected.families), std::move(detected.graphs)});
    names.push_back(files.name);
  }
  if (progress) progress("refining the rig", 0);
  RigRefinementOptions refinement_options;
  refinement_options.points = options.points;
  const RigRefinement refinement = refine_rig_on_frames(rig, curves, refinement_options);
  const ordered_json report = refinement_report(refinement, names);
  write_json(out / kRefinementFile, report);
  write_rig(refinement.rig, out / kRigFile);  // last: its presence means that refinement is done
  outcome = refinement_outcome(report);
  return refinement.rig;
}

}  // namespace

SequenceOutcome reconstruct_sequence(const fs::path& rig_path, const fs::path& frames_path,
                                     const fs::path& out, const SequenceOptions& options,
                                     const Progress& progress) {
  Rig rig = read_rig(rig_path);
  std::vector<FrameFiles> frames = find_frames(rig, frames_path);
  if (!options.plain_frames.empty()) add_plain_frames(rig, options.plain_frames, frames);
  if (options.refine_rig && is_output_rig(rig_path, out)) {
    throw InputError("--rig", "", rig_path.string(),
                     "must not be the rig.json in --out, where the refined rig is written");
  }
  if (options.points.solution.method == Method::kSingleProjector && !shows_grid(rig)) {
    throw InputError(rig_path.string(), "projectors", "",
                     "must hold one with a vertical and a horizontal pattern, which the method "
                     "single-projector needs");
  }
  check_images(rig, frames, progress);
  const ordered_json inputs = describe_inputs(rig_path, frames, options.description);
  const std::vector<char> there = resumable(out, frames, inputs, options);

  // From here on the output may change. What is to be made anew goes first, so that an abort leaves
  // no frame that claims to be of these inputs and is not.
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (there[i] == 0) fs::remove_all(out / frames[i].name);
  }
  if (!options.refine_rig || std::find(there.begin(), there.end(), 1) == there.end())
    remove_refined_rig(out, rig_path);
  write_json(out / kInputsFile, inputs);

  SequenceOutcome result;
  if (options.refine_rig)
    rig = refined_rig(rig, frames, out, options, progress, result.refinement.emplace());
  // The rig in use, so that the output can be looked at without its input.
  if (!is_output_file(rig_path, out / kDevicesFile)) write_rig(rig, out / kDevicesFile);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    FrameOutcome outcome;
    outcome.name = frames[i].name;
    if (there[i] != 0) {
      outcome.done = outcome.resumed = true;
    } else {
      try {
        reconstruct_frame(rig, frames[i], out / frames[i].name, options, outcome);
      } catch (const std::exception& error) {
        outcome.failure = error.what();
      }
    }
    result.frames.push_back(std::move(outcome));
    if (progress) {
      progress("frame " + frames[i].name,
               static_cast<double>(i + 1) / static_cast<double>(frames.size()));
    }
  }
  return result;
}

}  // namespace pencilscan
